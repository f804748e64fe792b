"""Fuzzes a living master at both doors, gRPC and HTTP, over real sockets: doors.py [--seconds N] [--seed S] [--keep FOLDER]

Requests are those that a farm has really sent, changed; requests made up from the protocol; bytes that are no request. What
must hold: the master lives, answers each request with success or one error of the documented codes that says something,
stays within its memory, and jobs that run meanwhile end with the pixels of `candela render`.

Rounds of two kinds take turns. In a quiet one a worker renders a job while requests come. In a wild one the fuzzer also
registers, leases units, fails them, and delivers rubbish for them; the jobs of such a round promise nothing."""
import argparse
import collections
import hashlib
import json
import os
import random
import re
import socket
import subprocess
import sys
import tempfile
import time
import warnings
from concurrent import futures
from pathlib import Path

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

TEST = "doors"
try:
    import grpc
    from google.protobuf.message import DecodeError
    from mutate import Mutator
    from protocol import Recorder, read_calls
except ImportError as error:
    print(f"doors.py:1: Skipped\nDebian's python3-grpcio or python3-protobuf is absent: {error}\n[  SKIPPED ] {TEST} (0 ms)")
    sys.exit(77)

PROGRAMS = Path(os.environ["CANDELA_PROGRAMS"])
SOURCE = Path(os.environ["CANDELA_SOURCE_DIR"])
SCENE = SOURCE / "deploy/scenes/cornell/scene.xml"
TOKEN = "correct-horse-battery-staple"
MEMORY = 1500 << 20  # bytes that the master may take
ROUND = 20           # seconds of a round
CODE = grpc.StatusCode
# INTERNAL is gRPC's own answer to bytes that are no message; UNKNOWN is a handler that threw.
NEVER = (CODE.UNKNOWN, CODE.UNIMPLEMENTED)
PAGES = ("/", "/healthz", "/metrics", "/api/jobs", "/api/jobs?offset=0", "/api/jobs/JOB", "/api/jobs/JOB/details", "/api/workers",
         "/api/workers/WORKER", "/api/stream", "/api/stream?job=JOB&kind=image", "/api/stream?worker=WORKER",
         "/api/jobs/JOB/tile?kind=image&level=0&x=0&y=0", "/api/jobs/JOB/pixel?kind=image&x=1&y=1", "/jobs/JOB", "/workers",
         "/api/groups", "/api/groups/JOB", "/api/jobs/JOB/image.png?exposure=1", "/api/throughput", "/api/blobs/BLOB")
DEEDS = ("pause", "resume", "cancel", "priority", "extend", "drain", "repair")


SUBMISSION = json.dumps({
    "name": "by http", "bundle": {"main_path": "a", "files": [{"path": "a", "sha256": "0" * 64, "size_bytes": 1}]},
    "settings": {"integrator": "path", "width": 4, "height": 4, "filter": "box", "sampler": "sobol", "isa": "avx2", "seed": 1},
    "stop": {"iterations": 1}})


class Finding(Exception):
    """What must not happen."""


class Doors:
    def __init__(self, seed, folder):
        self.random = random.Random(seed)
        self.folder = folder
        self.children = []
        self.counts = collections.Counter()
        self.recent = collections.deque(maxlen=40)
        (folder / "token").write_text(TOKEN + "\n")
        (folder / "token").chmod(0o600)
        os.environ["XDG_STATE_HOME"] = str(folder / "state")
        # The product's master, which also tells of violated invariants of its scheduler (tests/farm/checked_master.h).
        self.master = self.child("checked-master", "--listen", "127.0.0.1:0", "--http", "127.0.0.1:0", "--data", folder / "data",
                                 "--page-token-file", folder / "token", "--unit-time", "0.3", "--lease-time", "5",
                                 "--checkpoint-interval", "1")
        said = self.log = folder / "checked-master-0.log"
        found = self.eventually("the master listens",
                                lambda: re.search(r"listening on (\S+)\nhttp on (\S+):(\d+)\n", said.read_text()))
        self.address, self.http = found[1], (found[2], int(found[3]))
        options = [("grpc.max_receive_message_length", 64 << 20), ("grpc.max_send_message_length", 64 << 20)]
        self.channel = grpc.insecure_channel(self.address, options)
        self.calls = read_calls(SOURCE / "proto", (folder / "data" / "token").read_text().strip())
        self.by_name = {call.name: call for call in self.calls.values()}
        self.mutator = Mutator(self.random, [])
        self.sessions = []  # (worker_id, session) of workers that the fuzzer plays

    def child(self, program, *arguments):
        with open(self.folder / f"{program}-{len(self.children)}.log", "wb") as log:
            self.children.append(subprocess.Popen([PROGRAMS / program, *arguments], stdout=log, stderr=log))
        return self.children[-1]

    def close(self):
        for child in reversed(self.children):
            if child.poll() is None:
                child.terminate()
        for child in self.children:
            child.wait(120)

    def eventually(self, what, condition, seconds=180):
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            if value := condition():
                return value
            self.check_master()
            time.sleep(0.3)
        raise Finding(f"within {seconds} s not so: {what}")

    def check_master(self):
        if (code := self.master.poll()) is not None:
            raise Finding(f"the master ended with {code}")
        if violation := re.search(r"^invariant violated: .*", self.log.read_text(errors="replace"), re.M):
            raise Finding(violation[0])
        resident = int(re.search(r"VmRSS:\s+(\d+)", Path(f"/proc/{self.master.pid}/status").read_text())[1]) << 10
        self.counts["peak MB"] = max(self.counts["peak MB"], resident >> 20)
        if resident > MEMORY:
            raise Finding(f"the master takes {resident >> 20} MB")

    def candela(self, *arguments, master=None, fails=False):
        done = subprocess.run([PROGRAMS / "candela", *map(str, arguments), *(("--master", master) if master else ())],
                              capture_output=True, text=True, check=False, timeout=300)
        if done.returncode and not fails:
            raise Finding(f"candela {arguments[0]}: {done.stderr.strip()}")
        return done.stdout

    def state(self, job):
        return json.loads(self.candela("show", job, "--json", master=self.address))["state"]

    # Answers of a real farm.

    def record(self):
        recorder = Recorder(self.channel, self.calls)
        proxy = grpc.server(futures.ThreadPoolExecutor(32), handlers=[recorder])
        address = f"127.0.0.1:{proxy.add_insecure_port('127.0.0.1:0')}"
        proxy.start()
        worker = self.child("candela-worker", "--master", address, "--cache", self.folder / "recorded", "--threads", "1")
        jobs = []
        for integrator, more in (("path", ()), ("mmlt", ()), ("appm", ()), ("optimis", ("--set", "selection=trained")),
                                 ("bdpt", ("--aov", "albedo,depth"))):
            jobs.append(self.candela("submit", SCENE, "--integrator", integrator, "--size", "32x32", "--spp", "8", "--seed", "3",
                                     *more, master=address).strip())
        for job in jobs:
            self.candela("watch", job, master=address)
            self.candela("fetch", job, "-o", self.folder / "fetched.exr", master=address)
        for words in (("list",), ("workers",), ("events",), ("show", jobs[0]), ("pause", jobs[0]), ("resume", jobs[0]),
                      ("priority", jobs[0], "3"), ("extend", jobs[0], "--iterations", "+8"), ("verify",), ("repair", jobs[0]),
                      ("cancel", jobs[1]), ("drain", "nobody")):
            self.candela(*words, master=address, fails=True)
        # A unit that is handed back, a worker that leaves.
        long = self.candela("submit", SCENE, "--size", "64x64", "--iterations", "1000000", master=address).strip()
        self.eventually("the long job runs", lambda: self.state(long) == "running")
        worker.terminate()
        worker.wait(60)
        self.candela("cancel", long, master=address)
        proxy.stop(1)
        self.kept = recorder.kept
        never_sent = sorted(self.calls[path].name for path, kept in self.kept.items() if not kept)
        print(f"doors: {sum(map(len, self.kept.values()))} requests recorded, none of: {', '.join(never_sent) or '-'}", flush=True)
        known = re.findall(r'"([0-9a-f]{64})"', json.dumps([p.name for p in (self.folder / "data").rglob("*") if p.is_file()]))
        self.mutator.texts = [*jobs, long, *known[:20]]

    # gRPC.

    def requests(self, call):
        recorded = self.kept[call.path]
        if not call.streams_requests:
            return [self.mutator.request(call.request, [messages[0] for messages in recorded])]
        messages = list(self.random.choice(recorded)) if recorded and self.random.random() < 0.9 else [b""]
        at = self.random.randrange(len(messages))
        messages[at] = self.mutator.request(call.request, [messages[at]])
        how = self.random.random()
        if how < 0.1:
            messages = messages[:at]
        elif how < 0.2:
            messages += [self.random.choice(messages)] * self.random.choice((1, 1, 20))
        return messages

    def as_fake(self, call, messages):
        """The same from a worker whose session is good."""
        changed = []
        worker, session = self.random.choice(self.sessions)
        for raw in messages:
            if not self.parsable(call, [raw]):
                changed.append(raw)
                continue
            message = call.request.FromString(raw)
            held = message
            if call.name == "PushDelta":
                held = message.header if message.HasField("header") else None
            if held is not None and "session" in held.DESCRIPTOR.fields_by_name:
                held.worker_id, held.session = worker, session
                if self.leases and "token" in held.DESCRIPTOR.fields_by_name:
                    lease = self.random.choice(self.leases)
                    held.token = lease.token
                    if call.name == "PushDelta":
                        held.job_id, held.unit_id = lease.job_id, lease.unit_id
                        held.unit.CopyFrom(lease.unit)
            changed.append(message.SerializeToString())
        return changed

    def parsable(self, call, messages):
        try:
            with warnings.catch_warnings(record=True) as warned:  # of bytes left over after a message
                warnings.simplefilter("always")
                for raw in messages:
                    call.request.FromString(raw)
            return not warned
        except DecodeError:
            return False

    def ask(self, call, messages, seconds=20):
        """The status code; answers are read, of streams the first three."""
        self.recent.append((call.name, [raw[:2000].hex() for raw in messages[:4]]))
        sent = iter(messages) if call.streams_requests else messages[0]
        answers = []
        try:
            if call.streams_answers:
                stream = call.on(self.channel)(sent, timeout=seconds)
                for answer in stream:
                    answers.append(answer)
                    if len(answers) == 3:
                        stream.cancel()
                        break
            else:
                answers.append(call.on(self.channel)(sent, timeout=seconds))
            code = CODE.OK
        except grpc.RpcError as error:
            code = error.code()
            parsable = self.parsable(call, messages)
            if code in NEVER or (code == CODE.INTERNAL and parsable):
                raise Finding(f"{call.name}: {code.name}: {error.details()}") from None
            if code == CODE.DEADLINE_EXCEEDED and call.name not in ("WatchJob", "DrainWorker"):
                raise Finding(f"{call.name}: no answer in {seconds} s") from None
            if parsable and not (error.details() or "").strip():
                raise Finding(f"{call.name}: {code.name} without a word") from None
        for answer in answers:
            call.answer.FromString(answer)
        self.counts[f"grpc {code.name}"] += 1
        return code, answers

    def fuzz_grpc(self, wild):
        call = self.random.choice(list(self.calls.values()))
        messages = self.requests(call)
        if wild and self.sessions and self.random.random() < 0.7:
            messages = self.as_fake(call, messages)
        # A watch ends with its job; a drain that waits ends with the worker's leases.
        self.ask(call, messages, 1 if call.name in ("WatchJob", "DrainWorker") else 20)

    def play_worker(self):
        """Registers now and then, and takes leases that it will misuse."""
        if len(self.sessions) < 4:
            good = [raw for raw, in self.kept["/candela.v1.WorkerService/Register"]]
            call = self.by_name["Register"]
            code, answers = self.ask(call, [self.random.choice(good)])
            if code == CODE.OK:
                registered = call.answer.FromString(answers[0])
                self.sessions.append((registered.worker_id, registered.session))
        if self.sessions:
            call = self.by_name["AcquireLease"]
            worker, session = self.random.choice(self.sessions)
            code, answers = self.ask(call, [call.request(worker_id=worker, session=session).SerializeToString()])
            if code != CODE.OK:
                self.sessions.remove((worker, session))
            elif (answer := call.answer.FromString(answers[0])).HasField("lease"):
                self.leases.append(answer.lease)
                del self.leases[:-8]

    def fuzz_stream_of_bytes(self):
        """Bytes at the port of gRPC that are no HTTP/2, or break off within it."""
        preface = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
        settings = bytes.fromhex("000000040000000000")
        kind = bytes([self.random.choice((0, 1, 3, 4, 6, 7, 8, 9))])
        frame = self.random.randbytes(3) + kind + self.random.randbytes(505)
        sent = self.random.choice((self.random.randbytes(200), preface, preface + settings + frame, b"\x16\x03\x01\x02\0",
                                   self.mutator.data(preface + settings), b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"))
        host, port = self.address.rsplit(":", 1)
        self.recent.append(("bytes", sent.hex()))
        with socket.create_connection((host, int(port)), timeout=20) as link:
            try:
                link.sendall(sent)
                if self.random.random() < 0.5:
                    link.shutdown(socket.SHUT_WR)
                link.settimeout(0.02)
                link.recv(4096)
            except OSError:
                pass
        self.counts["bytes at the port of gRPC"] += 1

    # HTTP.

    def fuzz_http(self):
        choose = self.random.choice
        texts = self.mutator.texts or ["x"]
        page = choose(PAGES) if self.random.random() < 0.7 else f"/api/{choose(('jobs', 'groups', 'workers'))}/JOB/{choose(DEEDS)}"
        blob = self.random.randbytes(choose((0, 1, 5000)))
        page = page.replace("BLOB", choose((hashlib.sha256(blob).hexdigest(), "0" * 64, "x")))
        page = page.replace("JOB", choose(texts)).replace("WORKER", choose([w for w, _ in self.sessions] or texts))
        method = "POST" if page.rsplit("/", 1)[-1] in DEEDS else "GET"
        if page == "/api/jobs" and self.random.random() < 0.6:
            method = "POST"
        if page.startswith("/api/blobs/") and self.random.random() < 0.6:
            method = "PUT"
        if self.random.random() < 0.1:
            method = choose(("GET", "POST", "HEAD", "PUT", "OPTIONS", "G\0T", ""))
        body = "" if method == "GET" else choose(("", "priority=5", "iterations=1", "seconds=nan", "relmse=1e-9",
                                                  "priority=" + "9" * 400, "a" * 100_000))
        if method == "POST" and page == "/api/jobs":
            body = choose(("{}", "[" * 5000, '{"settings":{"width":-1}}', '{"stop":{"relmse":"NaN"}}', '{"name":"\\ud800"}', SUBMISSION))
        content = blob if method == "PUT" else body.encode()

        def mostly(right, *wrong):
            return right if self.random.random() < 0.9 else choose(wrong)
        fields = [("Host", mostly(f"{self.http[0]}:{self.http[1]}", "localhost", "evil.example", "")),
                  ("Authorization", mostly(f"Bearer {TOKEN}", "Bearer x", "Basic eA==", "")),
                  ("Content-Length", mostly(str(len(content)), "0", "-1", "99999999999999999999", "1e3")),
                  ("Connection", "close")]
        if self.random.random() < 0.1:
            fields.append(("Transfer-Encoding", "chunked"))
        if self.random.random() < 0.1:
            fields += [(f"X-{i}", "y" * choose((1, 5000))) for i in range(choose((1, 50, 500)))]
        text = f"{method} {page} HTTP/1.1\r\n" + "".join(f"{n}: {v}\r\n" for n, v in fields) + "\r\n"
        sent = text.encode("utf-8", "surrogatepass") + content
        if self.random.random() < 0.4:
            sent = self.mutator.data(sent)
        self.recent.append(("http", sent[:3000].hex()))
        began = time.monotonic()
        answer = b""
        with socket.create_connection(self.http, timeout=20) as link:
            try:
                link.sendall(sent)
                link.shutdown(socket.SHUT_WR)
                while b"\r\n\r\n" not in answer and (more := link.recv(65536)):
                    answer += more
            except TimeoutError:
                raise Finding("http: neither an answer nor an end in 20 s") from None
            except OSError:
                pass  # it may close the connection on what is no request
        self.counts["http slowest ms"] = max(self.counts["http slowest ms"], int(1000 * (time.monotonic() - began)))
        if not answer:
            self.counts["http closed"] += 1
            return
        found = re.match(rb"HTTP/1\.[01] (\d{3}) ", answer)
        if not found or int(found[1]) >= 500 and int(found[1]) != 503:
            raise Finding(f"http: answered {answer[:200]!r}")
        self.counts[f"http {found[1].decode()}"] += 1

    # Rounds.

    def fuzz(self, until, wild):
        self.leases = []
        while time.monotonic() < until():
            for _ in range(200):
                door = self.random.random()
                if wild and door < 0.05:
                    self.play_worker()
                elif door < 0.8:
                    self.fuzz_grpc(wild)
                elif door < 0.98:
                    self.fuzz_http()
                else:
                    self.fuzz_stream_of_bytes()
            self.check_master()
            self.counts["requests"] += 200
        self.ask(self.by_name["GetServerInfo"], [b""], 5)

    def end_jobs(self):
        """Cancels what is open: jobs that the fuzzer submitted."""
        def none_open():
            listed = json.loads(self.candela("list", "--state", "running,queued,paused", "--json", master=self.address))["jobs"]
            for job in listed:
                self.candela("cancel", job["id"], master=self.address, fails=True)
            return not listed
        self.eventually("all jobs are ended", none_open)

    def quiet_round(self, end):
        worker = self.child("candela-worker", "--master", self.address, "--cache", self.folder / "cache", "--threads", "1")
        job = self.candela("submit", SCENE, *self.HONEST, "--priority", "1000000", master=self.address).strip()
        self.fuzz(lambda: end, False)
        self.eventually("the job ends", lambda: self.state(job) in ("done", "failed", "cancelled"), 600)
        if (state := self.state(job)) != "done":
            raise Finding(f"the job of a quiet round is {state}")
        self.candela("fetch", job, "-o", self.folder / "farm.exr", master=self.address)
        difference = json.loads(self.candela("compare", self.folder / "farm.exr", self.folder / "alone.exr", "--json"))
        if difference["rmse"] != 0:
            raise Finding(f"the picture is another: {difference}")
        self.end_jobs()
        if worker.poll() is not None:
            raise Finding(f"the worker ended with {worker.returncode}")
        worker.terminate()
        worker.wait(60)
        self.counts["rounds with the pixels of candela render"] += 1

    HONEST = ("--size", "64x64", "--iterations", "700", "--seed", "7")

    def run(self, seconds):
        self.candela("render", SCENE, "-o", self.folder / "alone.exr", *self.HONEST, "--quiet")
        self.record()
        end = time.monotonic() + seconds
        wild = False
        while time.monotonic() < end:
            round_end = min(end, time.monotonic() + min(ROUND, seconds / 2))
            if wild:
                self.fuzz(lambda: round_end, True)
                self.end_jobs()
                self.sessions.clear()
            else:
                self.quiet_round(round_end)
            wild = not wild
        self.candela("verify", master=self.address, fails=True)
        self.check_master()
        self.master.terminate()
        if self.master.wait(120) not in (0, -15, 143):
            raise Finding(f"the master ended with {self.master.returncode}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="a folder for what led to a finding")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="candela-doors-") as scratch:
        doors = None
        try:
            doors = Doors(given.seed, Path(scratch))
            doors.run(given.seconds)
        except Finding as found:
            print(f"doors: FAILED (seed {given.seed}): {found}\nthe last requests, the newest last:")
            for what, sent in list(doors.recent if doors else [])[-3:]:
                print(f"  {what} {str(sent)[:1500]}")
            log = Path(scratch) / "checked-master-0.log"
            if log.exists():
                print(log.read_text(errors="replace")[-3000:])
            if given.keep and doors:
                given.keep.mkdir(parents=True, exist_ok=True)
                (given.keep / "requests.json").write_text(json.dumps(list(doors.recent)))
                (given.keep / "master.log").write_bytes(log.read_bytes())
            return 1
        finally:
            if doors:
                doors.close()
        print("doors:", ", ".join(f"{value} {name}" for name, value in sorted(doors.counts.items())))
    return 0


if __name__ == "__main__":
    sys.exit(main())
