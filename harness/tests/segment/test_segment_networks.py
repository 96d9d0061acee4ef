# SPDX-License-Identifier: Apache-2.0
"""Files of catalog/networks/, and the network that comes with the checkout on generated people."""

from __future__ import annotations

import hashlib
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest

from slambed.data.catalog import Catalog
from slambed.data.prepared import PreparedSequence
from slambed.errors import SlambedError
from slambed.native import find_program
from slambed.segment.mask_cache import LABELS_FILE, LABELS_KEY, MaskCache
from slambed.segment.masks import TRUTH, encode_jpeg, mask_cache, mask_key
from slambed.segment.network import load_network, network_file, network_names, networks_folder
from slambed.segment.segmenter import Segmenter

OURS = "slambed_people"


def test_every_network_is_described_and_ours_is_here_and_small() -> None:
    assert {OURS, "mediapipe_selfie"} <= set(network_names())
    for name in network_names():
        network = load_network(name)
        assert network.license and network.provenance and network.moves
    ours = network_file(load_network(OURS))
    assert ours.stat().st_size == load_network(OURS).size_bytes <= 4e6


def test_ours_was_not_trained_on_what_it_is_tested_on() -> None:
    made = load_network(OURS).made
    trained = range(*made["training_seeds"])
    assert not set(trained) & set(range(*made["held_out_seeds"]))
    for dataset in Catalog.load().datasets.values():
        if dataset.synthetic is not None and dataset.synthetic.people:
            assert dataset.synthetic.seed not in trained


def test_bad_network_files_are_one_line(tmp_path: Path) -> None:
    with pytest.raises(SlambedError, match="did you mean 'slambed_people'"):
        load_network("slambed_peple")
    text = (networks_folder() / f"{OURS}.yaml").read_text()
    file = tmp_path / f"{OURS}.yaml"
    for wrong, expected in (
        (text.replace("moves: [person]", "moves: [car]"), "car"),
        (text + "color: red\n", "color"),
        (text.replace(f"file: {OURS}.onnx\n", ""), "file and wheel"),
    ):
        file.write_text(wrong)
        with pytest.raises(SlambedError, match=expected) as error:
            load_network(str(file))
        assert "\n" not in str(error.value)


def test_another_file_than_the_described_one_is_refused(tmp_path: Path) -> None:
    network = load_network(OURS)
    assert network.file is not None
    (tmp_path / network.file).write_bytes(b"something else")
    with pytest.raises(SlambedError, match="sha256 is"):
        network_file(network, tmp_path)
    with pytest.raises(SlambedError, match="cannot be read"):
        network_file(network, tmp_path / "none")
    with pytest.raises(SlambedError, match="no network that can be read"):
        Segmenter(network, tmp_path / network.file)


def test_torn_pictures_and_impossible_thresholds_are_one_line() -> None:
    segmenter = Segmenter(load_network(OURS))
    jpeg = encode_jpeg(np.full((48, 64), 90, np.uint8), 90)
    for torn in (b"", b"no jpeg", jpeg[:20]):
        with pytest.raises(SlambedError, match="cannot be decoded"):
            segmenter.segment(torn, 0.8)
    for n_m in (-0.1, 1.1, float("nan")):
        with pytest.raises(SlambedError, match="n_m"):
            segmenter.segment(jpeg, n_m)


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> PreparedSequence:
    """Two people who sit in front of the camera, with labels."""
    folder = tmp_path_factory.mktemp("people") / "clip"
    command = [str(find_program("slambed-synth")), "--out", str(folder), "--labels"]
    command += ["--sensor", "mono", "--trajectory", "xyz", "--people", "2", "--seed", "31"]
    command += ["--activity", "sitting", "--fps", "1", "--seconds", "4", "--texel-scale", "3"]
    subprocess.run(command, check=True, capture_output=True)
    return PreparedSequence.open(folder)


@pytest.mark.programs
def test_labels_of_the_generator_are_read(people: PreparedSequence) -> None:
    file = people.path / LABELS_FILE
    assert hashlib.sha256(file.read_bytes()).hexdigest() == people.info.source["labels_sha256"]
    labels = MaskCache.open(file, LABELS_KEY)
    assert len(labels) == len(people)
    frame = labels.frame(0)
    assert (frame.width, frame.height, len(frame.instances)) == (640, 480, 2)
    assert 0.05 < frame.moving().mean() < 0.6


@pytest.mark.programs
def test_ours_gives_the_same_maps_with_more_threads(people: PreparedSequence) -> None:
    """Its accuracy is reported in its file (tools/score_people.py) and not tested here."""
    network = load_network(OURS)
    net = cv2.dnn.readNetFromONNX(str(network_file(network)))
    gray = cv2.resize(np.asarray(people.gray(0)), (network.input.width, network.input.height))
    blob = (gray.astype(np.float32) / 255)[None, None]
    reported = []
    for threads in (1, 2):
        cv2.setNumThreads(threads)
        net.setInput(blob)
        reported.append([np.array(plane) for plane in net.forward(list(network.outputs))])
    assert [plane.shape for plane in reported[0]] == [(1, 1, 128, 160), (1, 22, 64, 80)]
    assert all(np.array_equal(one, two) for one, two in zip(*reported, strict=True))
    assert reported[0][0].std() > 0  # the output depends on the image


@pytest.mark.programs
def test_masks_are_kept_per_network_quality_and_n_m(
    people: PreparedSequence, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path))
    keys = {
        mask_key(people, network, quality, n_m)
        for network, quality, n_m in ((OURS, 90, 0.8), (OURS, 20, 0.8), (OURS, 90, 0.6))
    }
    assert len(keys) == 3
    made = mask_cache(people, OURS, 90, 0.8)
    assert mask_cache(people, OURS, 90, 0.8) == made
    assert mask_cache(people, OURS, 20, 0.8) != made
    truth = MaskCache.open(mask_cache(people, TRUTH, 90, 0.8))
    labels = MaskCache.open(people.path / LABELS_FILE, LABELS_KEY)
    assert all(
        np.array_equal(truth.frame(i).moving(), labels.frame(i).moving()) for i in range(len(truth))
    )


@pytest.mark.programs
def test_masks_of_a_network_do_not_come_from_the_labels(
    people: PreparedSequence, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "with"))
    made = mask_cache(people, OURS, 90, 0.8).read_bytes()
    bare = tmp_path / "bare"
    bare.mkdir()
    for file in people.path.iterdir():
        if file.name != LABELS_FILE:
            (bare / file.name).write_bytes(file.read_bytes())
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "without"))
    sequence = PreparedSequence.open(bare)
    assert mask_cache(sequence, OURS, 90, 0.8).read_bytes() == made
    with pytest.raises(SlambedError, match="cannot be read"):
        mask_cache(sequence, TRUTH, 90, 0.8)
