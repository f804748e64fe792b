"""What the tests of deploy/ share: the manifests as objects, and how a test says why it is skipped."""
import os
import subprocess
import sys
from pathlib import Path

SOURCE = Path(os.environ["CANDELA_SOURCE_DIR"])
PROGRAMS = Path(os.environ["CANDELA_PROGRAMS"])
KUBERNETES = SOURCE / "deploy/kubernetes"


def skip(test, reason):
    """In the words that deploy/check reads of skipped tests and their reasons."""
    print(f"{test}:1: Skipped\n{reason}\n[  SKIPPED ] {test} (0 ms)")
    sys.exit(77)


def load(test):
    """All objects of the kustomization's resources, by (kind, name)."""
    try:
        import yaml
    except ImportError:
        skip(test, "there is no python3-yaml (Debian: python3-yaml)")
    listed = yaml.safe_load((KUBERNETES / "kustomization.yaml").read_text())["resources"]
    objects = [each for name in listed for each in yaml.safe_load_all((KUBERNETES / name).read_text())]
    return {(each["kind"], each["metadata"]["name"]): each for each in objects}


def pod_of(workload):
    return workload["spec"]["template"]["spec"]


def recipe():
    """The instructions of the Containerfile, continued lines joined: a list of (word, rest) a stage."""
    stages = []
    text = (SOURCE / "deploy/container/Containerfile").read_text().replace("\\\n", " ")
    for line in text.splitlines():
        if not line.strip() or line.startswith("#"):
            continue
        word, rest = line.split(None, 1)
        if word == "FROM":
            stages.append([])
        stages[-1].append((word, rest))
    return stages


def needed_libraries(program):
    said = subprocess.run(["objdump", "-p", program], capture_output=True, text=True, check=True).stdout
    return {line.split()[1] for line in said.splitlines() if line.strip().startswith("NEEDED")}
