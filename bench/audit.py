"""Known vulnerabilities of the pinned packages: `make audit`.

pip-audit asks the package index, and ends well when the index knows a package and not its vulnerabilities, as a mirror
does. So its report is read: a vulnerability fails, a package that could not be asked about is named.
"""

import json
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

EXIT_VULNERABLE = 1
EXIT_FAULT = 2
# What pip-audit's last lines hold when the service was not reached, or did not answer as it should.
_NOT_REACHED = ("ConnectionError", "ReadTimeout", "ServiceError", "blocking this service")


def main(files: Sequence[str]) -> int:
    worst = 0
    for file in files:
        command = [sys.executable, "-m", "pip_audit", "--disable-pip", "--require-hashes", "--format=json"]
        done = subprocess.run(
            [*command, "--progress-spinner=off", f"--requirement={file}"], capture_output=True, text=True
        )
        exit_code, text = verdict(done.stdout, done.stderr)
        print(f"{file}: {text}", file=sys.stderr if exit_code else sys.stdout)
        worst = max(worst, exit_code)
    return worst


def verdict(report: str, complaints: str) -> tuple[int, str]:
    """Exit code and sentence for what pip-audit wrote."""
    try:
        packages = json.loads(report)["dependencies"]
    except ValueError:
        if any(word in complaints for word in _NOT_REACHED):
            return 0, "the vulnerability service could not be asked: it was not reached."
        return EXIT_FAULT, f"pip-audit failed: {complaints.strip()}"
    vulnerable = [package for package in packages if package.get("vulns")]
    if vulnerable:
        return EXIT_VULNERABLE, "\n".join(["known vulnerabilities:", *map(_line, vulnerable)])
    skipped = [package["name"] for package in packages if "skip_reason" in package]
    if len(skipped) == len(packages):
        return 0, f"the vulnerability service could not be asked about any of {len(packages)} packages."
    text = f"no known vulnerability in {len(packages) - len(skipped)} packages"
    return 0, f"{text}; not asked: {', '.join(skipped)}." if skipped else f"{text}."


def _line(package: dict[str, Any]) -> str:
    found = (f"{one['id']} (mended in {', '.join(one['fix_versions']) or 'no version'})" for one in package["vulns"])
    return f"  {package['name']} {package['version']}: {', '.join(found)}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
