"""The manifests of Kubernetes name what exists, ask for no rights, and kustomize accepts them; the container recipe has the
libraries that the programs load."""
import os
import shutil
import subprocess
import sys
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from manifests import KUBERNETES, PROGRAMS, SOURCE, load, needed_libraries, pod_of, recipe

OBJECTS = load("deploy_manifests")
MASTER = OBJECTS["StatefulSet", "candela-master"]
WORKER = OBJECTS["Deployment", "candela-worker"]


class Manifests(unittest.TestCase):
    def test_selectors_find_pods(self):
        """Claim: services, the disruption budget and the autoscaler mean the pods that the file makes."""
        labels = [each["spec"]["template"]["metadata"]["labels"] for each in (MASTER, WORKER)]
        selectors = [each["spec"]["selector"]["matchLabels"] for each in (MASTER, WORKER)]
        selectors.append(OBJECTS["PodDisruptionBudget", "candela-worker"]["spec"]["selector"]["matchLabels"])
        selectors += [each["spec"]["selector"] for (kind, _), each in OBJECTS.items() if kind == "Service"]
        self.assertEqual(len(selectors), 5)
        for selector in selectors:
            self.assertTrue(any(selector.items() <= each.items() for each in labels), selector)
        target = OBJECTS["HorizontalPodAutoscaler", "candela-worker"]["spec"]["scaleTargetRef"]
        self.assertIn((target["kind"], target["name"]), OBJECTS)
        self.assertNotIn("replicas", WORKER["spec"], "an apply would undo the autoscaler")
        self.assertIn(("Service", MASTER["spec"]["serviceName"]), OBJECTS)

    def test_ports_and_mounts_exist(self):
        """Claim: each probe and service means a port of the container, each mount a volume of the pod or a claim."""
        for workload in (MASTER, WORKER):
            pod = pod_of(workload)
            claims = {each["metadata"]["name"] for each in workload["spec"].get("volumeClaimTemplates", [])}
            volumes = {each["name"] for each in pod["volumes"]} | claims
            for container in pod["containers"]:
                self.assertLessEqual({each["name"] for each in container["volumeMounts"]}, volumes)
        master = pod_of(MASTER)["containers"][0]
        ports = {each["name"]: each["containerPort"] for each in master["ports"]}
        for probe in ("startupProbe", "readinessProbe", "livenessProbe"):
            self.assertIn(master[probe]["httpGet"]["port"], ports)
        for (kind, _), each in OBJECTS.items():
            for port in each["spec"]["ports"] if kind == "Service" else []:
                self.assertEqual(port["port"], ports[port["targetPort"]])

    def test_pods_have_no_rights(self):
        """Claim: no pod runs as root, writes its root folder, or may gain what it lacks; so does the image."""
        for workload in (MASTER, WORKER):
            pod = pod_of(workload)
            self.assertEqual(pod["securityContext"]["runAsUser"], 65534)
            self.assertTrue(pod["securityContext"]["runAsNonRoot"])
            self.assertFalse(pod["automountServiceAccountToken"])
            for container in pod["containers"]:
                rights = container["securityContext"]
                self.assertTrue(rights["readOnlyRootFilesystem"])
                self.assertFalse(rights["allowPrivilegeEscalation"])
                self.assertEqual(rights["capabilities"], {"drop": ["ALL"]})
        image = dict(recipe()[-1])
        self.assertEqual(image["USER"], "65534:65534")
        self.assertEqual(image["STOPSIGNAL"], "SIGTERM")

    def test_kustomize(self):
        """Claim: kubectl builds the whole, and every object of the files is in it, with the configuration's hash."""
        if not shutil.which("kubectl"):
            self.skipTest("there is no kubectl (Debian: kubernetes-client)")
        built = subprocess.run(["kubectl", "kustomize", KUBERNETES], capture_output=True, text=True, check=False)
        self.assertEqual(built.returncode, 0, built.stderr)
        import yaml
        objects = {(each["kind"], each["metadata"]["name"]): each for each in yaml.safe_load_all(built.stdout)}
        self.assertLessEqual(set(OBJECTS), set(objects))
        made = [name for kind, name in objects if kind == "ConfigMap"]
        self.assertEqual(len(made), 1)
        volumes = pod_of(objects["Deployment", "candela-worker"])["volumes"]
        self.assertIn({"name": "config", "configMap": {"name": made[0]}}, volumes)

    def test_image_has_the_libraries(self):
        """Claim: packages-runtime.txt lists the packages of the libraries that the programs name, and no other."""
        if not (shutil.which("dpkg") and shutil.which("objdump")):
            self.skipTest("not a Debian machine with binutils")
        folder = {line.split()[0]: line.split()[-1] for line in
                  subprocess.run(["/sbin/ldconfig", "-p"], capture_output=True, text=True, check=True).stdout.splitlines()
                  if "=>" in line and "x86-64" in line}
        libraries = set().union(*(needed_libraries(program) for program in
                                  (PROGRAMS / "candela", PROGRAMS / "candela-master", PROGRAMS / "candela-worker",
                                   *PROGRAMS.glob("candela-*.so"))))
        # A file may be known by its path, by that of what it links to, and with or without /usr.
        names = {library: {each for path in (folder[library], os.path.realpath(folder[library]))
                           for each in (path.removeprefix("/usr"), "/usr" + path.removeprefix("/usr"))}
                 for library in libraries}
        said = subprocess.run(["dpkg", "-S", *sorted(set().union(*names.values()))], capture_output=True, text=True,
                              check=False).stdout
        owner = {line.split(": ", 1)[1]: line.split(":", 1)[0] for line in said.splitlines() if ": " in line}
        packages = set()
        for library, paths in names.items():
            found = {owner[path] for path in paths if path in owner}
            self.assertTrue(found, f"no package has {library}")
            packages |= found
        listed = {line for line in (SOURCE / "deploy/container/packages-runtime.txt").read_text().splitlines()
                  if line and not line.startswith("#")}
        always = {"libc6", "libgcc-s1", "zlib1g"}  # every Debian has them
        without_vdb = {"libopenvdb10.0", "libblosc1"}  # where the tests' machine builds without OpenVDB
        self.assertLessEqual(packages - always, listed)
        self.assertLessEqual(listed - packages, without_vdb)

    def test_sources_of_the_image(self):
        """Claim: .dockerignore lets in what CMake needs without tests: every folder that the top file names."""
        kept = {line[1:] for line in (SOURCE / ".dockerignore").read_text().splitlines() if line.startswith("!")}
        top = (SOURCE / "CMakeLists.txt").read_text()
        for folder in ("proto", "common", "worker", "master", "client"):
            self.assertIn(f"add_subdirectory({folder})", top)
            self.assertIn(folder, kept)


if __name__ == "__main__":
    unittest.main(verbosity=2)
