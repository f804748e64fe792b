"""What a report is made of, and how each piece looks in HTML and in Markdown."""
import base64
import html
import io
import os

from PIL import Image  # comes with Debian's matplotlib


class Heading:
    def __init__(self, text):
        self.text = text

    def html(self):
        return f"<h2>{html.escape(self.text)}</h2>"

    def markdown(self, _pictures):
        return f"### {self.text}\n\n"


class Note:
    """A line about what was left out."""

    def __init__(self, text):
        self.text = text

    def html(self):
        return f"<p class=warning>{html.escape(self.text)}</p>"

    def markdown(self, _pictures):
        return f"*{self.text}*\n\n"


class Picture:
    """A PNG: within the page of HTML, beside one of Markdown."""

    def __init__(self, name, data):
        self.name, self.data = name, data

    def html(self):
        return f'<img alt="" src="data:image/png;base64,{base64.b64encode(self.data).decode()}">'

    def markdown(self, pictures):
        """pictures: (folder, link to it)."""
        folder, link = pictures
        os.makedirs(folder, exist_ok=True)
        write_whole(os.path.join(folder, self.name + ".png"), smaller(self.data))
        return f"![{self.name}]({link}/{self.name}.png)\n\n"


class Table:
    def __init__(self, header, lines):
        self.header, self.lines = header, lines

    def html(self):
        def cells(tag, values):
            return "<tr>" + "".join(f"<{tag}>{html.escape(str(v))}</{tag}>" for v in values) + "</tr>"
        return "<table>" + cells("th", self.header) + "".join(cells("td", line) for line in self.lines) + "</table>"

    def markdown(self, _pictures):
        def cells(values):
            return "| " + " | ".join(str(v).replace("|", "\\|") for v in values) + " |\n"
        return (cells(self.header) + "|---" * len(self.header) + "|\n"
                + "".join(cells(line) for line in self.lines) + "\n")


def smaller(data):
    """The PNG as a repository keeps it: at most 1400 pixels wide, of 256 colours."""
    image = Image.open(io.BytesIO(data)).convert("RGB")
    if image.width > 1400:
        image = image.resize((1400, round(image.height * 1400 / image.width)), Image.Resampling.LANCZOS)
    out = io.BytesIO()
    image.quantize(256).save(out, "png", optimize=True)
    return out.getvalue()


def write_whole(file, data):
    """Text or bytes, under its name only when it is all there."""
    data = data.encode() if isinstance(data, str) else data
    part = file + ".part"
    with open(part, "wb") as stream:
        stream.write(data)
        stream.flush()
        os.fsync(stream.fileno())
    os.replace(part, file)
