"""Claim: links of README.md and docs/ lead to files and headings; pages of docs/ that sources name exist; a page has at most 1,200 words.

usage: check_docs.py SOURCE_DIR | --self-test"""
import re
import sys
import tempfile
from pathlib import Path

MAX_WORDS = 1200
LONG = {"docs/cli.md", "docs/plugins.md", "docs/lab/error-coverage.md"}  # generated, and a record
MADE_UP = {"test_report.py", "check_docs.py"}  # name pages that tests make
SOURCES = ("common", "worker", "master", "client", "proto", "deploy", "tests")
KINDS = {".cpp", ".h", ".py", ".sh", ".proto", ".toml", ".md", ".txt", ".xml", ".service", ".yaml"}


def slug(heading):
    """The anchor of a heading, as browsers of repositories make it."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower()
    return re.sub(r"[^\w\- ]", "", text).strip().replace(" ", "-")


def anchors(page):
    return {slug(heading) for heading in re.findall(r"^#+ (.*)$", page.read_text(), re.M)}


def faults(root):
    pages = [root / "README.md", *sorted(root.glob("docs/**/*.md"))]
    for page in pages:
        name, text = page.relative_to(root), page.read_text()
        words = len(text.split())
        if words > MAX_WORDS and str(name) not in LONG:
            yield f"{name}: {words} words; a page has at most {MAX_WORDS}"
        for link in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)):
            if "://" in link:
                continue
            path, _, anchor = link.partition("#")
            target = page.parent / path if path else page
            if not target.exists():
                yield f"{name}: {link} leads nowhere"
            elif anchor and target.suffix == ".md" and anchor not in anchors(target):
                yield f"{name}: {link} names no heading"
    for folder in SOURCES:
        for source in sorted((root / folder).glob("**/*")):
            if source.suffix not in KINDS or not source.is_file() or source.name in MADE_UP:
                continue
            for named in re.findall(r"(?<![\w/.-])docs/[\w/.-]+\.md", source.read_text(errors="replace")):
                if not (root / named).exists():
                    yield f"{source.relative_to(root)}: there is no {named}"


def self_test():
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        (root / "docs").mkdir()
        (root / "common").mkdir()
        (root / "README.md").write_text("[good](docs/a.md#a-page) [gone](docs/b.md) [no heading](docs/a.md#other)\n")
        (root / "docs/a.md").write_text("# A page\n" + "word " * (MAX_WORDS + 1))
        (root / "common/a.h").write_text("// docs/a.md, docs/c.md\n")
        found = list(faults(root))
        assert len(found) == 4, found
    return []


if __name__ == "__main__":
    FOUND = self_test() if sys.argv[1:] == ["--self-test"] else list(faults(Path(sys.argv[1])))
    print(*FOUND, sep="\n", file=sys.stderr)
    sys.exit(bool(FOUND))
