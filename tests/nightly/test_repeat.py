"""Claim: tests/nightly/repeat runs each test as often as asked, counts what passes, ends what hangs with all that it started, and
goes on where it was stopped. On a folder whose tests are commands of the shell."""
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

REPEAT = Path(__file__).resolve().parent / "repeat"


class Repeat(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = Path(temporary.name)

    def tell_ctest(self, **tests):
        """Tells CTest of tests, each appending its name to the file `ran`, by name: (command, further properties)."""
        lines = []
        for name, (command, *properties) in tests.items():
            lines.append(f'add_test({name} "/bin/sh" "-c" "echo {name} >> ran; {command}")\n'
                         f'set_tests_properties({name} PROPERTIES LABELS farm WORKING_DIRECTORY "{self.folder}" {" ".join(properties)})\n')
        (self.folder / "CTestTestfile.cmake").write_text("".join(lines))

    def ran(self, name):
        file = self.folder / "ran"
        return file.read_text().split().count(name) if file.exists() else 0

    def repeat(self, *options):
        return subprocess.run([sys.executable, REPEAT, "--build", self.folder, *options], capture_output=True, text=True, check=False)

    def test_counts(self):
        # The third run of `rare` fails.
        self.tell_ctest(good=("true",), rare=("test `grep -c rare ran` -ne 3",), skipped=("exit 77",))
        done = self.repeat("--runs", "5", "--idle")
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertRegex(done.stdout, r"good +idle +5/5 ")
        self.assertRegex(done.stdout, r"not all passed: rare +idle +4/5 ")
        self.assertRegex(done.stdout, r"skipped +idle +skipped ")
        self.assertEqual([self.ran(name) for name in ("good", "rare", "skipped")], [5, 5, 1])

    def test_load_runs_tests_together_but_none_beside_itself(self):
        for_each = "mkdir {0} || exit 1; sleep 0.3; ls -d in_* | wc -l >> together; rmdir {0}"
        self.tell_ctest(**{name: (for_each.format("in_" + name),) for name in ("one", "two", "three")})
        done = self.repeat("--runs", "3", "--load", "--together", "3")
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertEqual([self.ran(name) for name in ("one", "two", "three")], [3, 3, 3])
        self.assertGreaterEqual(max(int(word) for word in (self.folder / "together").read_text().split()), 2)

    def test_late(self):
        self.tell_ctest(late=("sleep 60 & echo $! > child; wait", "TIMEOUT 1"))
        done = self.repeat("--runs", "1", "--idle")
        self.assertRegex(done.stdout, r"late +idle +0/1 ")
        child = int((self.folder / "child").read_text())
        status = Path(f"/proc/{child}/stat")
        self.assertTrue(not status.exists() or status.read_text().rsplit(")")[1].split()[0] == "Z", "its child lives")

    def test_goes_on(self):
        self.tell_ctest(slow=("sleep 0.2",))
        process = subprocess.Popen([sys.executable, REPEAT, "--build", self.folder, "--runs", "500", "--idle"], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        results = self.folder / "nightly/repeat/runs.jsonl"
        while not results.exists() or results.read_text().count("\n") < 2:
            time.sleep(0.05)
        process.send_signal(signal.SIGTERM)
        process.wait()
        kept, ran = results.read_text().count("\n"), self.ran("slow")
        self.assertEqual(self.repeat("--runs", str(kept + 3), "--idle").returncode, 0)
        self.assertEqual(self.ran("slow"), ran + 3)
        self.assertEqual(self.repeat("--runs", "2", "--idle", "--again").returncode, 0)
        self.assertEqual(self.ran("slow"), ran + 5)

    def test_what_a_test_needs_is_made(self):
        self.tell_ctest(make=("touch made", "FIXTURES_SETUP it"), use=("test -e made", "FIXTURES_REQUIRED it", 'ENVIRONMENT "A=b"'))
        self.assertEqual(self.repeat("--runs", "2", "--idle").returncode, 0)
        self.assertEqual([self.ran(name) for name in ("make", "use")], [1, 2])


if __name__ == "__main__":
    unittest.main()
