"""A cluster of Slurm on one machine, in a scratch folder: munged, slurmctld and a slurmd for each virtual node, all
with ports, keys and state of their own. Nothing of the machine's own Slurm is read or touched."""
import os
import pwd
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue", "scancel", "sinfo", "scontrol")
# Debian puts the daemons there, which is not in everybody's PATH.
os.environ["PATH"] = os.environ.get("PATH", "") + ":/usr/sbin:/sbin"


def missing_programs():
    return [name for name in PROGRAMS if shutil.which(name) is None]


def free_ports(count):
    sockets = [socket.socket() for _ in range(count)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


def eventually(condition, seconds=240, pause=0.5):
    """Whether the condition becomes true: patient, for a busy machine."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(pause)
    return bool(condition())


CONFIGURATION = """\
ClusterName=scratch
SlurmctldHost={host}(127.0.0.1)
SlurmUser={user}
SlurmdUser={user}
SlurmctldPort={port}
AuthType=auth/munge
AuthInfo=socket={folder}/munge/socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool-%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd-%n.pid
SlurmctldLogFile={folder}/log/slurmctld
SlurmdLogFile={folder}/log/slurmd-%n
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
JobAcctGatherType=jobacct_gather/none
MailProg=/bin/true
ReturnToService=2
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
SlurmdTimeout=5
KillWait=30
MinJobAge=3600
SchedulerParameters=sched_interval=1,sched_min_interval=0,bf_interval=1
{nodes}
PartitionName=spare Nodes=ALL Default=YES MaxTime=INFINITE PriorityTier=1 GraceTime=30 State=UP
PartitionName=urgent Nodes=ALL MaxTime=INFINITE PriorityTier=2 PreemptMode=OFF State=UP
"""


class Cluster:
    """`nodes` nodes of two processors; partitions "spare" and "urgent", whose jobs preempt those of "spare"."""

    def __init__(self, folder, nodes):
        self.folder, self.nodes = Path(folder), [f"n{i + 1}" for i in range(nodes)]
        self.daemons = {}
        for name in ("munge", "state", "log", *(f"spool-{node}" for node in self.nodes)):
            (self.folder / name).mkdir(mode=0o755)
        self.folder.chmod(0o755)  # munged trusts no socket in a folder that others cannot reach
        key = self.folder / "munge" / "key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        host = socket.gethostname().split(".")[0]
        controller, *ports = free_ports(nodes + 1)
        lines = [f"NodeName={node} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs=2 State=UNKNOWN"
                 for node, port in zip(self.nodes, ports)]
        configuration = self.folder / "slurm.conf"
        configuration.write_text(CONFIGURATION.format(host=host, user=pwd.getpwuid(os.getuid()).pw_name, port=controller,
                                                      folder=self.folder, nodes="\n".join(lines)))
        self.environment = dict(os.environ, SLURM_CONF=str(configuration))

    def _spawn(self, name, *command):
        with open(self.folder / "log" / f"{name}.out", "ab") as log:
            self.daemons[name] = subprocess.Popen(command, env=self.environment, stdout=log, stderr=log,
                                                  stdin=subprocess.DEVNULL)

    def start(self):
        munge = self.folder / "munge"
        self._spawn("munged", "munged", "--foreground", "--force", f"--key-file={munge}/key", f"--socket={munge}/socket",
                    f"--pid-file={munge}/pid", f"--log-file={munge}/log", f"--seed-file={munge}/seed")
        self._check(eventually((munge / "socket").exists, 60), "munged made no socket")
        self._spawn("slurmctld", "slurmctld", "-D", "-i")
        for node in self.nodes:
            self.start_node(node)
        self._check(eventually(lambda: self.run("sinfo", "-h", "-N", "-o", "%N %t", "-p", "spare", check=False).split() ==
                               [word for node in self.nodes for word in (node, "idle")], 120), "the nodes are not idle")

    def _check(self, fine, text):
        if fine:
            return
        logs = [f"{path}:\n{path.read_text(errors='replace')[-2000:]}" for path in sorted((self.folder / "log").iterdir())]
        raise RuntimeError(text + "\n" + "\n".join(logs))

    def start_node(self, node):
        self._spawn(f"slurmd-{node}", "slurmd", "-D", "-N", node)

    def kill_node(self, node, processes):
        """SIGKILL of the node's daemon and of `processes` on it."""
        daemon = self.daemons.pop(f"slurmd-{node}")
        daemon.kill()
        for pid in processes:
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
        daemon.wait()

    def run(self, *command, check=True, **more):
        done = subprocess.run(command, env=dict(self.environment, **more.pop("environment", {})), capture_output=True,
                              text=True, check=False, **more)
        if check and done.returncode != 0:
            raise RuntimeError(f"{' '.join(command)}: exit code {done.returncode}: {done.stderr}")
        return done.stdout

    def tasks(self, job):
        """State of each of a job's tasks that has not ended, by name: {"7_1": "RUNNING", ...}."""
        lines = self.run("squeue", "-h", "-r", "-j", job, "-o", "%i %T", check=False).splitlines()
        return dict(line.split() for line in lines)

    def stop(self):
        self.run("scancel", "-f", "--signal=KILL", "--full", "-u", pwd.getpwuid(os.getuid()).pw_name, check=False)
        self.run("scancel", "-u", pwd.getpwuid(os.getuid()).pw_name, check=False)
        eventually(lambda: not self.run("squeue", "-h", check=False).strip(), 20)
        for name in sorted(self.daemons, key=lambda name: name == "munged"):
            self.daemons[name].terminate()
        for daemon in self.daemons.values():
            try:
                daemon.wait(20)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()
