"""What pip-audit reports, and what CI makes of it."""

import json

import pytest

from bench.audit import EXIT_FAULT, EXIT_VULNERABLE, verdict

SOUND = {"name": "numpy", "version": "2.4.6", "vulns": []}
HURT = {"name": "pillow", "version": "9.0.0", "vulns": [{"id": "CVE-2022-22817", "fix_versions": ["9.0.1"]}]}
# As pip-audit writes it for a mirror that has the files and not the versions' pages; its exit code is 0.
UNKNOWN = {"name": "scipy", "skip_reason": "Dependency not found on PyPI and could not be audited: scipy (1.17.1)"}


@pytest.mark.parametrize(
    ("packages", "exit_code", "words"),
    [
        ([SOUND], 0, "no known vulnerability in 1 packages."),
        ([SOUND, UNKNOWN], 0, "in 1 packages; not asked: scipy."),
        ([UNKNOWN], 0, "could not be asked about any of 1 packages"),
        ([SOUND, HURT, UNKNOWN], EXIT_VULNERABLE, "pillow 9.0.0: CVE-2022-22817 (mended in 9.0.1)"),
    ],
)
def test_a_vulnerability_fails_and_a_package_that_nobody_knows_is_named(packages, exit_code, words):
    found, text = verdict(json.dumps({"dependencies": packages, "fixes": []}), "")
    assert found == exit_code and words in text


def test_no_network_is_said_and_fails_nothing():
    complaints = "Traceback ...\nrequests.exceptions.ConnectionError: HTTPSConnectionPool(host='pypi.org', port=443)"
    assert verdict("", complaints) == (0, "the vulnerability service could not be asked: it was not reached.")


def test_a_file_without_hashes_fails():
    found, text = verdict("", "ERROR:pip_audit._cli:requirement numpy does not contain a hash")
    assert found == EXIT_FAULT and "does not contain a hash" in text
