"""systemd accepts the units of deploy/systemd."""
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from manifests import PROGRAMS, SOURCE, skip

if not shutil.which("systemd-analyze"):
    skip("deploy_units", "there is no systemd-analyze (Debian: systemd)")

# Claim: no unknown directive, no bad value, also with the addition for TLS, and the programs are found where the units
# look for them.
with tempfile.TemporaryDirectory(prefix="candela-units-") as scratch:
    units = []
    for unit in sorted((SOURCE / "deploy/systemd").glob("*.service")):
        # The programs of this build in the place of installed ones.
        path = Path(scratch) / unit.name
        path.write_text(unit.read_text().replace("ExecStart=", f"ExecStart={PROGRAMS}/"))
        units.append(path)
        drop_in = Path(scratch) / f"{unit.name}.d" / "tls.conf"
        drop_in.parent.mkdir()
        shutil.copy(SOURCE / "deploy/systemd/tls.conf", drop_in)
    assert len(units) == 2, units
    done = subprocess.run(["systemd-analyze", "verify", "--man=no", *units], capture_output=True, text=True, check=False)
    said = [line for line in (done.stdout + done.stderr).splitlines() if "candela" in line]
    broken = Path(scratch) / "candela-broken.service"
    broken.write_text(units[0].read_text().replace("ProtectHome=yes", "ProtectHome=perhaps\nStopAfter=3"))
    wrong = Path(scratch) / f"{broken.name}.d" / "tls.conf"
    wrong.parent.mkdir()
    wrong.write_text("[Service]\nLoadCredentials=key.pem:/etc/candela/tls/key.pem\n")
    told = subprocess.run(["systemd-analyze", "verify", "--man=no", broken], capture_output=True, text=True, check=False)

if "ProtectHome" not in told.stderr and "StopAfter" not in told.stderr:
    skip("deploy_units", f"systemd-analyze verifies nothing here: {told.stderr.strip()[:200]}")
if "LoadCredentials" not in told.stderr:
    print("the addition for TLS is not read:", told.stderr)
    sys.exit(1)
if done.returncode != 0 or said:
    print("\n".join(said) or done.stderr)
    sys.exit(1)
print("systemd accepts", ", ".join(path.name for path in units))
