# SPDX-License-Identifier: Apache-2.0
"""Masks in campaigns: computed once from the transmitted pictures, part of the run key, and the
only way for the ground truth to reach a run."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest
from harness_parts import run_spec
from virtual_parts import fingerprints, make_sequence, needs_programs, plan_of

from slambed.campaign.folder import ResultFolder
from slambed.campaign.raw_folder import prepare_raw
from slambed.commands.main import run_command
from slambed.data.prepared import PreparedSequence
from slambed.errors import SlambedError
from slambed.native import find_program
from slambed.segment.frame_file import FrameFile
from slambed.segment.mask_cache import LABELS_FILE, MaskCache
from slambed.segment.masks import encode_jpeg
from slambed.segment.network import load_network
from slambed.spec import library
from slambed.spec.inputs import sha256_of
from slambed.spec.masks import Masks, MasksAsked

PEOPLE = ("--labels", "--sensor", "mono", "--trajectory", "xyz", "--people", "2", "--activity",
          "crossing", "--width", "320", "--height", "240", "--texel-scale", "4")  # fmt: skip
EXPERIMENT = """\
id: masked
title: People before the camera
systems:
  - {{system: edgeslam_semantic, variant: orbslam_offloaded, label: none}}
  - {{system: edgeslam_semantic, variant: maskslam_offloaded, label: "{label}",
      params: {{network: {network}}}}}
datasets: [{sequence}]
playback: {{mode: realtime, fps: 10}}
link: {{profiles: [infocom_wifi_5g]}}
devices: {{mobile: host, edge: edge_xeon_titan_v}}
engine: virtual
runs: {{default: 1}}
"""


@pytest.fixture(scope="module")
def crossing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_sequence(tmp_path_factory.mktemp("crossing") / "clip", 3, *PEOPLE)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def write(folder: Path, sequence: Path, network: str, label: str = "") -> Path:
    file = folder / "masked.yaml"
    text = EXPERIMENT.format(sequence=sequence, network=network, label=label or network)
    file.write_text(text)
    return file


def run(file: Path, results: Path) -> dict[str, str]:
    command = ["run", str(file), "--results", str(results), "--jobs", "1", "--no-figures"]
    assert run_command(command) == 0
    return fingerprints(ResultFolder(results / "masked"))


@needs_programs
@pytest.mark.programs
def test_masks_are_made_of_the_jpeg_that_is_sent(crossing: Path, tmp_path: Path) -> None:
    file = tmp_path / "pictures"
    command = [str(find_program("slambed-sim")), "--images", str(file), "--key", "test"]
    command += ["--sequence", str(crossing), "--quality", "90"]
    subprocess.run(command, check=True)
    sent, sequence = FrameFile.open(file, b"SLIC", "test"), PreparedSequence.open(crossing)
    for i in range(len(sequence)):
        assert sent.block(i)[8:] == encode_jpeg(sequence.gray(i), 90), f"frame {i}"


@needs_programs
@pytest.mark.programs
def test_runs_never_open_the_labels_and_masks_are_made_once(
    crossing: Path, tmp_path: Path, cache: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write(tmp_path, crossing, "truth")
    first = run(file, tmp_path / "first")
    assert "masks of walk by truth: 30 pictures" in capsys.readouterr().out
    (made,) = (cache / "masks").glob("*.masks")
    assert any(MaskCache.open(made).frame(i).instances for i in range(30))
    labels = crossing / LABELS_FILE
    labels.rename(tmp_path / "aside")
    try:
        assert run(file, tmp_path / "second") == first
    finally:
        (tmp_path / "aside").rename(labels)
    assert "masks of walk" not in capsys.readouterr().out
    events = "".join(p.read_text() for p in (tmp_path / "first").rglob("manifest.json"))
    assert '"network": "truth"' in events


@needs_programs
@pytest.mark.programs
def test_masks_are_in_the_run_key_by_their_content(crossing: Path, tmp_path: Path) -> None:
    plan = plan_of(write(tmp_path, crossing, "truth"))
    none, masked = plan.specs
    assert none.masks is None and "masks" not in none.meaning()
    assert masked.masks is not None and len(masked.masks.sha256) == 64
    assert "network" not in masked.params  # nodes do not know this parameter
    other = masked.masks.model_copy(update={"sha256": "0" * 64})
    moved = masked.masks.model_copy(update={"path": "/elsewhere"})
    assert masked.model_copy(update={"masks": other}).run_key != masked.run_key
    assert masked.model_copy(update={"masks": moved}).run_key == masked.run_key


def test_masks_that_are_gone_or_changed_make_no_result(tmp_path: Path) -> None:
    file = tmp_path / "some.masks"
    file.write_bytes(b"masks")
    masks = Masks(network="net", n_m=0.5, path=str(file), sha256=sha256_of(file))
    (tmp_path / "raw").mkdir()
    for changes in ({"masks": masks}, {"further_masks": [masks]}):
        file.write_bytes(b"masks")
        spec = run_spec(**changes)
        prepare_raw(spec, tmp_path / "raw")
        file.write_bytes(b"other")
        with pytest.raises(SlambedError, match=r"some\.masks has changed"):
            prepare_raw(spec, tmp_path / "raw")
        file.unlink()
        with pytest.raises(SlambedError, match=r"some\.masks is gone"):
            prepare_raw(spec, tmp_path / "raw")


@needs_programs
@pytest.mark.programs
def test_live_runs_segment_by_themselves(crossing: Path, tmp_path: Path, cache: Path) -> None:
    none, live = plan_of(write(tmp_path, crossing, "slambed_people"), "local").specs
    assert none.masks is None and live.masks is not None
    network = load_network("slambed_people")
    assert live.masks.meaning() == {
        "network": "slambed_people",
        "n_m": 0.8,
        "sha256": network.sha256,
    }
    assert live.masks.path == "" and not (cache / "masks").exists(), "a mask cache was made"
    with pytest.raises(SlambedError, match="which nothing can see in a picture") as error:
        plan_of(write(tmp_path, crossing, "truth"), "local")
    assert "\n" not in str(error.value)


def test_a_run_without_masks_keeps_its_key() -> None:
    assert json.dumps(run_spec().meaning()).count("masks") == 0
    made = Masks(network="slambed_people", n_m=0.8)
    assert run_spec(masks=made).run_key != run_spec().run_key


@needs_programs
@pytest.mark.programs
def test_what_is_wrong_with_a_network_is_one_line(
    crossing: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    described = tmp_path / "other.yaml"
    text = (Path(__file__).parents[3] / "catalog" / "networks" / "slambed_people.yaml").read_text()
    text = text.replace("id: slambed_people", "id: other")
    described.write_text(text.replace("file: slambed_people", "file: nothing_here"))
    for network, expected in (
        ("slambed_peple", "did you mean"),
        (str(described), "cannot be read"),
    ):
        with pytest.raises(SlambedError, match=expected) as error:
            plan_of(write(tmp_path, crossing, network, "other"))
        assert "\n" not in str(error.value)
    monkeypatch.setattr("slambed.segment.network.networks_folder", lambda: tmp_path)
    (tmp_path / "nothing_here.onnx").write_bytes(b"something else")
    with pytest.raises(SlambedError, match="sha256 is"):
        plan_of(write(tmp_path, crossing, "other"))


@needs_programs
@pytest.mark.programs
def test_a_sequence_without_labels_has_no_true_masks(tmp_path: Path) -> None:
    plain = make_sequence(tmp_path / "plain", 1, "--sensor", "mono")
    with pytest.raises(SlambedError, match="has no true masks"):
        plan_of(write(tmp_path, plain, "truth"))


def test_the_truth_is_named_in_every_table() -> None:
    system = library.Library().system("edgeslam_semantic")
    params = system.resolve("maskslam_offloaded", {"network": "truth"})
    with pytest.raises(SlambedError, match="must say 'truth'"):
        MasksAsked.of(system, params, "Mask-SLAM")
    assert MasksAsked.of(system, params, "Mask-SLAM, truth as masks") is not None
    plain = system.resolve("orbslam_offloaded", {})
    assert MasksAsked.of(system, plain, "ORB-SLAM") is None
