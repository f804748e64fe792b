"""A pod without a container engine: a root folder of its own that cannot be written, the image's programs, the manifest's
volumes, user, command and environment. Whoever uses it has mount and network namespaces of his own."""
import os
import shutil
import subprocess
from pathlib import Path

NOBODY = 65534


def run(*command):
    subprocess.run([str(word) for word in command], check=True, capture_output=True)


class Pod:
    """A root folder from the manifest of one pod."""

    def __init__(self, folder, name, spec, programs, files):
        """`spec`: the pod's. `programs`: the folder that the image has as /usr/local/bin. `files`: the content of volumes of
        config maps and secrets, by volume: {"config": {"config.toml": bytes}}."""
        self.name, self.spec, self.container = name, spec, spec["containers"][0]
        self.root = Path(folder) / name / "root"
        self.volumes = Path(folder) / name / "volumes"
        self.root.mkdir(parents=True)
        run("mount", "-t", "tmpfs", "-o", "mode=0755", "none", self.root)
        for word in ("usr", "proc", "dev", "etc", "tmp", "var/lib/candela", "var/cache/candela", "src"):
            (self.root / word).mkdir(parents=True)
        run("mount", "--bind", "/usr", self.root / "usr")
        run("mount", "--bind", programs, self.root / "usr/local/bin")
        for part in ("usr", "usr/local/bin"):
            run("mount", "-o", "remount,bind,ro", self.root / part)
        for link in ("bin", "sbin", "lib", "lib64"):
            if os.path.islink(f"/{link}"):
                (self.root / link).symlink_to(f"usr/{link}")
        run("mount", "-t", "proc", "none", self.root / "proc")
        run("mount", "--rbind", "/dev", self.root / "dev")
        for each in ("passwd", "group", "nsswitch.conf", "ld.so.cache"):
            if os.path.exists(f"/etc/{each}"):
                shutil.copy(f"/etc/{each}", self.root / "etc" / each)
        if os.path.isdir("/etc/alternatives"):  # Debian's libraries are links into it
            shutil.copytree("/etc/alternatives", self.root / "etc/alternatives", symlinks=True)
        (self.root / "etc/hosts").write_text("127.0.0.1 localhost candela-master\n")
        kinds = {volume["name"]: volume for volume in spec["volumes"]}
        for mount in self.container["volumeMounts"]:
            held = self.volumes / mount["name"]
            held.mkdir(parents=True)
            for name_of_file, content in files.get(mount["name"], {}).items():
                (held / name_of_file).write_bytes(content)
                os.chown(held / name_of_file, 0, spec["securityContext"]["fsGroup"])
                mode = kinds[mount["name"]].get("secret", {}).get("defaultMode", 0o644)
                os.chmod(held / name_of_file, mode)
            # As fsGroup does: the folder is the group's.
            os.chown(held, 0, spec["securityContext"]["fsGroup"])
            os.chmod(held, 0o2775)
            target = self.root / mount["mountPath"].lstrip("/")
            target.mkdir(parents=True, exist_ok=True)
            run("mount", "--bind", held, target)
            if mount.get("readOnly"):
                run("mount", "-o", "remount,bind,ro", target)

    def share(self, source, target):
        """A further folder, to be read. Before `seal`."""
        place = self.root / target.lstrip("/")
        place.mkdir(parents=True)
        run("mount", "--bind", source, place)
        run("mount", "-o", "remount,bind,ro", place)

    def seal(self):
        """readOnlyRootFilesystem."""
        run("mount", "-o", "remount,ro", self.root)
        return self

    def inside(self, command, environment=None):
        """The command line that runs `command` in the pod, as its user and without any capability."""
        given = {each["name"]: each.get("value", self.name) for each in self.container.get("env", [])}
        given.update({"PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", **(environment or {})})
        user = self.spec["securityContext"]
        return ["/usr/bin/env", "-i", *(f"{name}={value}" for name, value in given.items()), "/usr/sbin/chroot",
                str(self.root), "/usr/bin/setpriv", f"--reuid={user['runAsUser']}", f"--regid={user['runAsGroup']}",
                f"--groups={user['fsGroup']}", "--no-new-privs", "--bounding-set=-all", "--inh-caps=-all", "--", *command]

    def start(self, log):
        """The container's own command, exactly."""
        words = self.container["command"] + self.container.get("args", [])
        with open(log, "ab") as out:
            return subprocess.Popen(self.inside(words), stdout=out, stderr=out, stdin=subprocess.DEVNULL)

    def tell(self, *command):
        return subprocess.run(self.inside([str(word) for word in command]), capture_output=True, text=True, check=False)
