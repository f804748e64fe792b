"""Changed messages: fields set to edge values, dropped, repeated, and bytes turned over."""
import math
import struct

from google.protobuf.descriptor import FieldDescriptor as Field

INTEGERS = (0, 1, 2, 3, 7, 255, 256, 65535, 65536, 2**31 - 1, 2**31, 2**32 - 1, 2**32, 2**53, 2**63 - 1, 2**63, 2**64 - 1)
REALS = (0.0, -0.0, 1.0, -1.0, 1e-300, 1e300, -1e300, 5e-324, math.inf, -math.inf, math.nan, 0.5, 1e9)
TEXTS = ("", " ", "\n", "\0", "..", "/", "../../etc/passwd", "%s%n%x", "<script>", "'; DROP TABLE jobs; --", "é" * 300, "a" * 5000,
         "-1", "0", "1e999", "nan", "0" * 64, "f" * 64, "F" * 64, "path", "bdpt", "upbp", "optimis", "mmlt", "vcmplus", "film")
RANGES = {Field.TYPE_INT32: (-2**31, 2**31 - 1), Field.TYPE_SINT32: (-2**31, 2**31 - 1), Field.TYPE_SFIXED32: (-2**31, 2**31 - 1),
          Field.TYPE_UINT32: (0, 2**32 - 1), Field.TYPE_FIXED32: (0, 2**32 - 1), Field.TYPE_INT64: (-2**63, 2**63 - 1),
          Field.TYPE_SINT64: (-2**63, 2**63 - 1), Field.TYPE_SFIXED64: (-2**63, 2**63 - 1), Field.TYPE_UINT64: (0, 2**64 - 1),
          Field.TYPE_FIXED64: (0, 2**64 - 1), Field.TYPE_ENUM: (-2**31, 2**31 - 1)}


class Mutator:
    """Changes by `random`; `texts` are strings that mean something to the master, such as ids of jobs."""

    def __init__(self, random, texts):
        self.random = random
        self.texts = texts

    def text(self):
        return self.random.choice(self.texts if self.texts and self.random.random() < 0.6 else TEXTS)

    def data(self, old=b""):
        """`old` with some bytes turned, cut, doubled; or other bytes."""
        how = self.random.randrange(6)
        if not old or how == 0:
            return self.random.randbytes(self.random.choice((0, 1, 4, 8, 33, 1000, 70_000)))
        changed = bytearray(old)
        if how == 1:
            return bytes(changed[:self.random.randrange(len(changed))])
        if how == 2:
            at = self.random.randrange(len(changed))
            return bytes(changed[:at] + changed[at:] * 2)
        for _ in range(self.random.choice((1, 1, 2, 8))):
            at = self.random.randrange(len(changed))
            if how == 3:
                changed[at] ^= 1 << self.random.randrange(8)
            elif how == 4:
                changed[at] = self.random.choice((0, 1, 0x7f, 0x80, 0xff))
            else:  # an integer that a length or a count may be
                word = struct.pack("<Q", self.random.choice(INTEGERS))[:self.random.choice((4, 8))]
                changed[at:at + len(word)] = word
        return bytes(changed)

    def scalar(self, field, old=None):
        if field.type in (Field.TYPE_DOUBLE, Field.TYPE_FLOAT):
            return self.random.choice(REALS)
        if field.type == Field.TYPE_BOOL:
            return self.random.random() < 0.5
        if field.type == Field.TYPE_STRING:
            return self.text()
        if field.type == Field.TYPE_BYTES:
            return self.data(old or b"")
        least, most = RANGES[field.type]
        value = self.random.choice(INTEGERS) if self.random.random() < 0.7 else (old or 0) + self.random.choice((-1, 1))
        if field.type == Field.TYPE_ENUM and self.random.random() < 0.7:
            value = self.random.randrange(12)
        return min(max(-value if least < 0 and self.random.random() < 0.3 else value, least), most)

    def fill(self, message, depth=0):
        """Random fields of an empty message."""
        for field in message.DESCRIPTOR.fields:
            if self.random.random() < 0.5:
                self.change_field(message, field, depth)

    def change_field(self, message, field, depth):
        name = field.name
        whole = field.message_type is not None
        if field.label == Field.LABEL_REPEATED:
            if whole and field.message_type.GetOptions().map_entry:
                values = getattr(message, name)
                value = field.message_type.fields_by_name["value"]
                if value.message_type is None:
                    values[self.text()] = self.scalar(value)
                return
            values = getattr(message, name)
            how = self.random.randrange(4)
            if how == 0 and len(values):
                del values[self.random.randrange(len(values))]
            elif how == 1 and len(values):  # one many times
                one = values[self.random.randrange(len(values))]
                values.extend([one] * self.random.choice((1, 2, 300)))
            elif whole and depth < 4:
                self.change(values[self.random.randrange(len(values))], depth + 1) if len(values) else \
                    self.fill(values.add(), depth + 1)
            elif not whole:
                values.append(self.scalar(field))
        elif self.random.random() < 0.15:
            message.ClearField(name)
        elif whole:
            if depth < 4:
                self.change(getattr(message, name), depth + 1)
                getattr(message, name).SetInParent()
        else:
            setattr(message, name, self.scalar(field, getattr(message, name)))

    def change(self, message, depth=0):
        """One field, here or in a message within."""
        if message.DESCRIPTOR.fields:
            self.change_field(message, self.random.choice(message.DESCRIPTOR.fields), depth)

    def request(self, kind, recorded):
        """The bytes of a request of class `kind`: a recorded one changed (or not), or one made up."""
        message = kind()
        if recorded and self.random.random() < 0.9:
            raw = self.random.choice(recorded)
            if self.random.random() < 0.1:
                return self.data(raw)
            message.ParseFromString(raw)
            for _ in range(self.random.choice((0, 1, 1, 1, 2, 5))):
                self.change(message)
        else:
            self.fill(message)
        return message.SerializeToString()
