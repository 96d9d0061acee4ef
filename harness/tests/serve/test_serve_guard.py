# SPDX-License-Identifier: Apache-2.0
"""Which requests are answered, and which files are served."""

from pathlib import Path

import pytest

from slambed.serve.guard import PAGE_POLICY, file_in, is_our_name, parts_of, report_policy


@pytest.mark.parametrize("host", ["localhost:8350", "127.0.0.1:8350", "LOCALHOST:8350"])
def test_a_browser_on_this_machine_is_answered(host: str) -> None:
    assert is_our_name(host, 8350)


def test_the_usual_port_is_left_out_by_browsers() -> None:
    assert is_our_name("localhost", 80) and is_our_name("127.0.0.1:80", 80)
    assert not is_our_name("evil.example", 80)


@pytest.mark.parametrize(
    "host",
    [
        None, "", "localhost", "localhost:80", "evil.example:8350", "localhost.evil.example:8350",
        "127.0.0.1.nip.io:8350", "0.0.0.0:8350", "192.168.0.7:8350", "[::1]:8350",
        "localhost:8350@evil.example",
    ],
)  # fmt: skip
def test_any_other_name_is_refused(host: str | None) -> None:
    assert not is_our_name(host, 8350)


@pytest.mark.parametrize(
    "path",
    [
        "/..", "/../x", "/a/../b", "/a/./b", "/.work", "/a/.lock", "/a//b", "/a\\b", "/a\0b",
        "/-rf", "/a b", "/%2e%2e", "/a/%2e", "/ä", "/a;b", "/~root",
    ],
)  # fmt: skip
def test_a_path_with_any_other_part_is_none(path: str) -> None:
    assert parts_of(path) is None


def test_harmless_paths_are_split() -> None:
    assert parts_of("/") == []
    assert parts_of("/experiments/d_t2.v1/runs/0a1b/") == ["experiments", "d_t2.v1", "runs", "0a1b"]


def test_only_files_of_known_kinds_below_the_root_are_shown(tmp_path: Path) -> None:
    root, outside = tmp_path / "results", tmp_path / "secret.json"
    (root / "report").mkdir(parents=True)
    outside.write_text("{}")
    inside = root / "report" / "figures.json"
    inside.write_text("[]")
    (root / "report" / "tool.py").write_text("")
    (root / "report" / "leads_out.json").symlink_to(outside)
    (root / "report" / "leads_in.json").symlink_to(inside)
    (root / "elsewhere").symlink_to(tmp_path)
    assert file_in(root, ["report", "figures.json"]) == inside.resolve()
    assert file_in(root, ["report", "leads_in.json"]) == inside.resolve()
    for parts in (
        [], ["report"], ["report", "tool.py"], ["report", "none.json"],
        ["report", "leads_out.json"],
        ["elsewhere", "secret.json"], ["..", "secret.json"], ["report", "..", "..", "secret.json"],
        ["/etc/passwd"], [str(outside)],
    ):  # fmt: skip
        assert file_in(root, parts) is None, parts


def test_pages_load_nothing_from_elsewhere_and_hold_no_script() -> None:
    assert "default-src 'none'" in PAGE_POLICY and "script-src 'self'" in PAGE_POLICY
    assert "unsafe" not in PAGE_POLICY and "http" not in PAGE_POLICY


def test_a_report_runs_its_own_script_alone() -> None:
    # echo -n 'alert(1)' | openssl dgst -sha256 -binary | base64
    known = "'sha256-bhHHL3z2vDgxUt0W3dWQOrprscmda2Y5pLsLg4GF+pI='"
    assert f"script-src {known};" in report_policy(["alert(1)"])
    assert "script-src 'none';" in report_policy([])
