#!/usr/bin/python3
"""Renders a scene by a Woodcock coordinator, with nothing of Woodcock here: the contract comes from the server, by reflection.
submit.py HOST:PORT OUT.exr SAMPLES SCENE.pbrt [FILE ...]     the other files lie in the scene's folder or below it
"""
import hashlib, os, sys, uuid
import grpc
from google.protobuf import descriptor_pb2, descriptor_pool, empty_pb2, message_factory


class Coordinator:
    def __init__(self, address):
        self.channel, self.pool = grpc.insecure_channel(address), descriptor_pool.DescriptorPool()
        for service in "ScenesService", "BlobsService":
            self.learn(f"woodcock.v1.{service}")

    def learn(self, symbol):
        """Adds the file that defines it, and those it imports: field 4 of grpc.reflection.v1alpha, in question and answer."""
        ask = self.channel.stream_stream("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo")
        reply = next(ask(iter([b"\x22" + bytes([len(symbol)]) + symbol.encode()]), timeout=30))
        found = next(field.data for field in empty_pb2.Empty.FromString(reply).UnknownFields() if field.field_number == 4)
        files = {file.name: file for file in descriptor_pb2.FileDescriptorSet.FromString(found).file}
        while files:
            self.pool.Add(files.pop(next(name for name in files if not files.keys() & set(files[name].dependency))))

    def message(self, name, **fields):
        return message_factory.MessageFactory(self.pool).GetPrototype(self.pool.FindMessageTypeByName("woodcock.v1." + name))(**fields)

    def call(self, kind, service, method, request, seconds):
        """`kind` is unary_unary, stream_unary or unary_stream."""
        answer = type(self.message(method + "Response"))
        return getattr(self.channel, kind)(f"/woodcock.v1.{service}/{method}", lambda m: m.SerializeToString(),
                                           answer.FromString)(request, timeout=seconds)

    def upload(self, path):
        """Stores a file; returns its digest, which is the SHA-256 of its bytes."""
        content = open(path, "rb").read()
        header = dict(content_digest=hashlib.sha256(content).hexdigest(), total_bytes=len(content))
        parts = [dict(header=header)] + [dict(chunk=content[i:i + 2**20]) for i in range(0, len(content), 2**20)]
        self.call("stream_unary", "BlobsService", "Upload", (self.message("UploadRequest", **part) for part in parts), 3600)
        return header["content_digest"]


sys.excepthook = lambda _, error, trace: print("submit.py:", getattr(error, "details", lambda: error)(), file=sys.stderr)
missing = [file for file in sys.argv[4:] if not os.path.isfile(file)]
if len(sys.argv) < 5 or not sys.argv[3].isdigit() or missing:
    print(f"submit.py: there is no file {missing[0]}" if missing else "usage: " + __doc__.splitlines()[1], file=sys.stderr)
    sys.exit(2)
address, out, samples, scene, *others = sys.argv[1:]
c = Coordinator(address)
files = [dict(path=os.path.relpath(f, os.path.dirname(scene) or "."), content_digest=c.upload(f)) for f in [scene, *others]]
request = c.message("SubmitSceneRequest", request_id=uuid.uuid4().hex, files=files, settings=dict(samples=int(samples)))
job = c.call("unary_unary", "ScenesService", "SubmitScene", request, 300).job_id
for update in c.call("unary_stream", "JobsService", "WatchJob", c.message("WatchJobRequest", job_id=job), 7 * 86400):
    print(f"{job}: {update.job.progress.samples_done} of {update.job.progress.samples_total} samples", update.job.state_reason)
picture = c.call("unary_unary", "ScenesService", "GetPicture", c.message("GetPictureRequest", job_id=job), 3600)
with open(out, "wb") as file:
    download = c.message("DownloadRequest", content_digest=picture.content_digest)
    file.writelines(part.chunk for part in c.call("unary_stream", "BlobsService", "Download", download, 3600))
