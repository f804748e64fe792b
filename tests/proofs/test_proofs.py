#!/usr/bin/env python3
"""Claim: a test whose films, source and references are those of its line in the table is not run, and any other is.

Planted: a changed film, a missing line, a line of other films, an edited line, a changed source, a test that fails
while it is recorded, a test that renders what its probe does not, a test that is recorded after one of its scene, films that differ from one
run to the next; of a test in parts a new one, one whose films changed, and a change of what they share.
"""
import hashlib
import os
import subprocess
import sys
import tempfile
import unittest

PROGRAM = os.environ["CANDELA_PROOFS_SUBJECT"]
FIRST = "Subject.HasTheRadianceOfItsSky"
SECOND = "Subject.SharesAScene"
PARTS = "Subject.HasParts"
BUILD = "# build: "


def written(test, films, judge, commit):
    """A line whose check is right."""
    words = f"{test} {films} {judge} {commit}"
    return f"{words} {hashlib.sha256(words.encode()).hexdigest()[:8]}\n"


def lines_of(path):
    with open(path) as file:
        return file.readlines()


class Proofs(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def run_subject(self, how, tests="*", **more):
        """Exit code, output, and how many bodies ran in full."""
        mark = self.path("mark")
        if os.path.exists(mark):
            os.remove(mark)
        environment = dict(os.environ, CANDELA_PROOFS=how, SUBJECT_MARK=mark, **more)
        environment.pop("CANDELA_LONG", None)
        done = subprocess.run([PROGRAM, f"--gtest_filter={tests}"], env=environment, capture_output=True, text=True, timeout=300)
        count = len(lines_of(mark)) if os.path.exists(mark) else 0
        return done.returncode, done.stdout + done.stderr, count

    def record(self, **more):
        out = self.path("lines")
        code, text, _ = self.run_subject(f"record-all={out}", CANDELA_COMMIT="c0ffee", **more)
        return code, text, "".join(line for line in lines_of(out) if not line.startswith("#"))

    def table(self, *lines):
        with open(self.path("table"), "w") as file:
            file.write(BUILD + "some\n" + "".join(lines))
        return "table=" + self.path("table")

    def good_line(self, test=FIRST):
        _, _, lines = self.record()
        return "".join(line for line in lines.splitlines(True) if line.split()[0] == test)

    def test_same_films_are_not_rendered_in_full(self):
        code, text, count = self.run_subject(self.table(self.good_line()))
        self.assertEqual((code, count), (0, 1), text)
        self.assertIn(f"[  PROVED  ] {FIRST} at c0ffee", text)

    def test_recording_writes_what_passed_and_was_probed_whole(self):
        code, text, lines = self.record()
        self.assertEqual(code, 0, text)
        self.assertEqual([line.split()[0] for line in lines.splitlines()], [FIRST, SECOND])
        self.assertIn("no line: the probe did not render", text)

    def test_a_line_holds_for_a_test_alone(self):
        code, text, _ = self.run_subject(self.table(self.good_line(SECOND)), tests=SECOND)
        self.assertEqual(code, 0, text)
        self.assertIn(f"[  PROVED  ] {SECOND} at c0ffee", text)

    def test_recording_writes_no_line_of_films_that_differ_by_chance(self):
        code, text, lines = self.record(SUBJECT_RUNS=self.path("runs"))
        self.assertEqual(code, 0, text)
        self.assertEqual([line.split()[0] for line in lines.splitlines()], [FIRST, SECOND])
        self.assertIn("no line: a second probe rendered other films", text)

    def test_recording_writes_no_line_of_a_failure(self):
        code, text, lines = self.record(SUBJECT_RADIANCE="0.6")
        self.assertEqual((code, [line.split()[0] for line in lines.splitlines()]), (1, [SECOND]), text)

    def test_a_changed_film_runs_in_full_and_is_judged(self):
        table = self.table(self.good_line())
        code, text, count = self.run_subject(table, SUBJECT_RADIANCE="0.6")
        self.assertEqual((code, count), (1, 2), text)
        self.assertIn("films differ from those proved at c0ffee", text)
        self.assertIn("tests/nightly/prove", text)

    def test_a_missing_line_runs_in_full(self):
        other = written("Subject.LooksBeforeItRendersAll", "0" * 16, "0" * 16, "c0ffee")
        code, text, count = self.run_subject(self.table(other))
        self.assertEqual((code, count), (0, 2), text)
        self.assertIn(f"{FIRST}: not in the table", text)

    def test_a_line_of_other_films_runs_in_full(self):
        test, _, judge, commit, _ = self.good_line().split()
        code, text, count = self.run_subject(self.table(written(test, "0" * 16, judge, commit)))
        self.assertEqual((code, count), (0, 2), text)
        self.assertIn("films differ", text)
        self.assertIn("another build (some;", text)

    def test_another_source_runs_in_full(self):
        test, films, _, commit, _ = self.good_line().split()
        code, text, count = self.run_subject(self.table(written(test, films, "0" * 16, commit)))
        self.assertEqual((code, count), (0, 2), text)
        self.assertIn("its source is not that of c0ffee", text)

    def test_an_edited_line_is_refused(self):
        line = self.good_line().replace("c0ffee", "decade")
        code, text, count = self.run_subject(self.table(line))
        self.assertEqual((code, count), (2, 0), text)
        self.assertIn("table:2: the line of " + FIRST, text)

    def test_a_test_twice_is_refused(self):
        line = self.good_line()
        code, text, _ = self.run_subject(self.table(line, line))
        self.assertEqual(code, 2, text)
        self.assertIn("stands here twice", text)

    def parts_that_run(self, how, parts, shared="0.125", **more):
        code, text, _ = self.run_subject(how, tests=PARTS, SUBJECT_PARTS=parts, SUBJECT_SHARED=shared, **more)
        self.assertEqual(code, 0, text)
        mark = self.path("mark")
        return text, [line.strip() for line in lines_of(mark)] if os.path.exists(mark) else []

    def test_parts_have_lines_of_their_own(self):
        out = self.path("lines")
        self.parts_that_run(f"record-all={out}", "a=0.25,b=0.75", CANDELA_COMMIT="c0ffee")
        lines = [line for line in lines_of(out) if not line.startswith("#")]
        self.assertEqual([line.split()[0] for line in lines], [PARTS + "#a", PARTS + "#b"])
        table = self.table(*lines)

        text, ran = self.parts_that_run(table, "a=0.25,b=0.75")
        self.assertIn(f"[  PROVED  ] {PARTS} at c0ffee", text)
        self.assertEqual(ran, [])
        text, ran = self.parts_that_run(table, "a=0.25,b=0.75,c=0.5")
        self.assertIn(f"{PARTS}#c: not in the table", text)
        self.assertEqual(ran, ["c=0.5"])
        text, ran = self.parts_that_run(table, "a=0.25,b=0.5")
        self.assertIn(f"{PARTS}#b: films differ from those proved at c0ffee", text)
        self.assertEqual(ran, ["b=0.5"])
        # Recorded beside those: the new one alone runs and gets a line.
        more = self.path("more")
        _, ran = self.parts_that_run(f"record={more}", "a=0.25,b=0.75,c=0.5", CANDELA_COMMIT="decade", CANDELA_PROOFS_KNOWN=self.path("table"))
        self.assertEqual(ran, ["c=0.5"])
        self.assertEqual([line.split()[0] for line in lines_of(more) if not line.startswith("#")], [PARTS + "#c"])
        _, ran = self.parts_that_run(table, "a=0.25,b=0.75", shared="0.25")
        self.assertEqual(ran, ["a=0.25", "b=0.75"])

    def test_the_committed_table_is_whole(self):
        code, text, _ = self.run_subject("table=" + os.environ["CANDELA_PROOFS_TABLE"])
        self.assertEqual(code, 0, text)

    def test_another_word_is_refused(self):
        code, text, _ = self.run_subject("of")
        self.assertEqual(code, 2, text)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
