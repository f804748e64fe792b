"""The farm's protocol as data: every call with its request and answer, read from proto/, and calls of bytes."""
import subprocess
import tempfile
from pathlib import Path

import grpc
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

FILES = ("candela/v1/job.proto", "candela/v1/client.proto", "candela/v1/worker.proto")


class Call:
    """One rpc: `path` as on the wire, classes of its messages, whether requests or answers are streams."""

    def __init__(self, method, class_of, token):
        self.metadata = (("candela-token", token),)
        self.name = method.name
        self.path = f"/{method.containing_service.full_name}/{method.name}"
        self.request = class_of(method.input_type)
        self.answer = class_of(method.output_type)
        declared = descriptor_pb2.MethodDescriptorProto()
        method.CopyToProto(declared)
        self.streams_requests = declared.client_streaming
        self.streams_answers = declared.server_streaming

    def on(self, channel):
        """A callable of bytes in and bytes out."""
        kind = {(False, False): channel.unary_unary, (True, False): channel.stream_unary,
                (False, True): channel.unary_stream, (True, True): channel.stream_stream}
        made = kind[self.streams_requests, self.streams_answers](self.path, request_serializer=None, response_deserializer=None)
        return lambda request, timeout=None: made(request, timeout=timeout, metadata=self.metadata)


def time_left(context):
    """Seconds; None for a call without a deadline."""
    left = context.time_remaining()
    return left if left is not None and left < 1e6 else None


def read_calls(proto, token):
    """All calls of the services in folder `proto`, by path; they carry the master's token."""
    with tempfile.NamedTemporaryFile(suffix=".pb") as made:
        subprocess.run(["protoc", "-I", proto, "--include_imports", f"--descriptor_set_out={made.name}", *FILES], check=True)
        described = descriptor_pb2.FileDescriptorSet.FromString(Path(made.name).read_bytes())
    pool = descriptor_pool.DescriptorPool()
    for file in described.file:
        pool.Add(file)
    factory = message_factory.MessageFactory(pool)
    calls = [Call(method, factory.GetPrototype, token) for name in FILES for service in
             pool.FindFileByName(name).services_by_name.values() for method in service.methods]
    return {call.path: call for call in calls}


class Recorder(grpc.GenericRpcHandler):
    """A proxy that keeps what goes to the master: for each call up to 40 requests (of a stream all its messages)."""

    KEPT = 40
    LARGEST = 200_000  # bytes of a request or a stream that is kept

    def __init__(self, channel, calls):
        self.calls = calls
        self.channel = channel
        self.kept = {path: [] for path in calls}

    def keep(self, path, messages):
        if sum(map(len, messages)) <= self.LARGEST and len(self.kept[path]) < self.KEPT:
            self.kept[path].append(messages)

    def service(self, details):
        call = self.calls.get(details.method)
        if call is None:
            return None
        kind = {(False, False): grpc.unary_unary_rpc_method_handler, (True, False): grpc.stream_unary_rpc_method_handler,
                (False, True): grpc.unary_stream_rpc_method_handler, (True, True): grpc.stream_stream_rpc_method_handler}
        relay = self.relay_stream if call.streams_answers else self.relay_one
        return kind[call.streams_requests, call.streams_answers](lambda request, context: relay(call, request, context))

    def outgoing(self, call, request):
        if not call.streams_requests:
            self.keep(call.path, [request])
            return request
        seen = []

        def chunks():
            for chunk in request:
                seen.append(chunk)
                yield chunk
            self.keep(call.path, seen)
        return chunks()

    def relay_one(self, call, request, context):
        if call.streams_requests:
            context.send_initial_metadata(())  # senders wait for it before they send the bulk
        try:
            return call.on(self.channel)(self.outgoing(call, request), timeout=time_left(context))
        except grpc.RpcError as error:
            context.abort(error.code(), error.details())

    def relay_stream(self, call, request, context):
        answers = call.on(self.channel)(self.outgoing(call, request), timeout=time_left(context))
        context.add_callback(answers.cancel)
        try:
            yield from answers
        except grpc.RpcError as error:
            if context.is_active():
                context.abort(error.code(), error.details())
