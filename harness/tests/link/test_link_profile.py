# SPDX-License-Identifier: Apache-2.0
"""Profiles: values over time, files, references, and a one-line error for each mistake."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slambed.engines.result import profile_rtt
from slambed.errors import SlambedError
from slambed.link.direction_tables import delay_table_ms
from slambed.link.impairments import outages_within
from slambed.link.modeled import modeled_link
from slambed.link.profile import load_profile, parse_profile, profile_names
from slambed.spec.run_spec import LinkSpec


def inline(rtt: Any, **keys: Any) -> dict[str, Any]:
    return {"rtt_ms": rtt, **keys}


@pytest.mark.parametrize(
    ("rtt", "values"),
    [
        (40, {-5: 40, 0: 40, 1e4: 40}),
        ({"constant": 7.5}, {3: 7.5}),
        ({"steps": [[0, 10], [5, 40], [6, 0]]}, {-1: 10, 4.999: 10, 5: 40, 6: 0, 99: 0}),
        ({"points": [[1, 10], [3, 30]]}, {0: 10, 2: 20, 5: 30}),
        ({"ramp": {"to_ms": 85, "rise_s": 43, "fall_s": 43}}, {21.5: 42.5, 43: 85, 64.5: 42.5}),
        ({"ramp": {"from_ms": 5, "to_ms": 9, "start_s": 2, "rise_s": 4}}, {1: 5, 4: 7, 60: 9}),
        ({"ramp": {"to_ms": 10, "rise_s": 1, "hold_s": 2, "fall_s": 1}}, {2.5: 10, 3.5: 5}),
        ({"sine": {"mean_ms": 30, "amplitude_ms": 20, "period_s": 4}}, {0: 30, 1: 50, 3: 10}),
        ({"sum": [5, {"points": [[0, 0], [10, 10]]}]}, {0: 5, 4: 9}),
        ({"clamp": {"max_ms": 20, "of": {"points": [[0, 0], [10, 100]]}}}, {1: 10, 5: 20}),
        ({"scale": {"factor": 0.5, "of": 30}}, {0: 15}),
        ({"delayed": {"by_s": 5, "of": {"points": [[0, 0], [2, 20]]}}}, {4: 0, 6: 10}),
        ({"repeat": {"period_s": 2, "of": {"points": [[0, 0], [2, 20]]}}}, {1: 10, 3: 10, 4: 0}),
    ],
)
def test_curves_are_functions_of_time(rtt: Any, values: dict[float, float]) -> None:
    profile = parse_profile(inline(rtt), "here")
    for t, expected in values.items():
        assert profile.rtt_ms(t) == pytest.approx(expected), t


def test_half_of_the_rtt_goes_each_way_unless_said_otherwise() -> None:
    assert parse_profile(inline(40), "here").delays_ms(1.0) == (20, 20)
    assert parse_profile(inline(40, up_share=0.75), "here").delays_ms(1.0) == (30, 10)
    apart = parse_profile({"one_way_ms": {"up": 5, "down": {"steps": [[0, 1], [2, 9]]}}}, "here")
    assert apart.delays_ms(3.0) == (5, 9)
    assert apart.rtt_ms(3.0) == 14


def test_duration_is_when_nothing_changes_any_more_unless_it_is_given() -> None:
    assert load_profile("none").duration == 0
    assert load_profile("ramp_85").duration == 86
    assert load_profile("sine").duration == 87  # as played in the paper
    wave = {"sine": {"mean_ms": 9, "amplitude_ms": 1, "period_s": 4}}
    assert parse_profile(inline(wave), "here").duration is None


RISING = inline({"points": [[0, 10], [4, 50]]}, duration_s=1)


def test_every_link_follows_the_curves_beyond_the_duration() -> None:
    """`duration_s` is of lists and plots."""
    profile = parse_profile(RISING, "here")
    assert (profile.duration, profile.settled_s) == (1, 4)
    up = modeled_link(profile, 60.0).up  # as in relay.json and sim.json
    assert up.delay_us[-1] == 25_000
    given = profile_rtt(LinkSpec(backend="relay", profile="x", content=dict(RISING)), 60.0)
    assert given.rtt_ms[-1] == 50
    still = parse_profile(inline({"points": [[0, 0], [4, 50]]}, duration_s=0), "here")
    assert not still.is_none


def test_a_step_at_the_very_end_holds_afterwards() -> None:
    """3.1 + 1.0 - 3.1 is less than 1.0."""
    late = inline({"delayed": {"by_s": 3.1, "of": {"steps": [[0, 10], [1.0, 80]]}}})
    profile = parse_profile(late, "here")
    up_ms, down_ms = delay_table_ms(profile, 60.0)
    assert up_ms == down_ms and (len(up_ms), up_ms[-2:]) == (412, [5, 40])
    link = LinkSpec(backend="relay", profile="x", content=dict(profile.content))
    assert profile_rtt(link, 60.0).rtt_ms[-2:] == [10, 80]
    early = parse_profile(inline({"steps": [[0, 10], [4.1, 80]]}), "here")
    assert (len(delay_table_ms(early, 60.0)[0]), len(delay_table_ms(profile, 2.0)[0])) == (411, 201)


def test_the_papers_profiles_have_the_papers_values() -> None:
    """DynNetSLAM, spec sections 7 and 10."""
    ramp = load_profile("ramp_85")
    assert ramp.rtt_ms(17.7) == pytest.approx(35, abs=0.05)
    assert ramp.rtt_ms(20.235) == pytest.approx(40, abs=0.01)
    assert ramp.rtt_ms(65.765) == pytest.approx(40, abs=0.01)
    assert ramp.rtt_ms(86) == ramp.rtt_ms(100) == 0
    t = np.arange(0.0005, 87, 0.001)
    literal, peak_to_peak = (load_profile(n).rtt_series_ms(t) for n in ("sine", "sine_p2p"))
    for t_s in (0.0, 3.3, 10.9, 40.0):
        wave = 40 + 30 * math.sin(2 * math.pi * t_s / 43) + 20 * math.sin(2 * math.pi * t_s / 4)
        assert load_profile("sine").rtt_ms(t_s) == pytest.approx(max(0.0, wave))
    assert np.count_nonzero(np.diff(literal > 40)) == 21
    assert np.count_nonzero(np.diff(peak_to_peak > 40)) == 9
    assert (literal == 0).mean() == pytest.approx(0.07, abs=0.005)
    assert (peak_to_peak.min(), peak_to_peak.max()) == pytest.approx((0, 80), abs=0.2)


def test_every_profile_file_can_be_used_or_says_what_data_it_lacks() -> None:
    names = profile_names()
    assert {"none", "constant", "ramp", "ramp_85", "sine", "sine_p2p", "ijnc_wifi"} <= set(names)
    for name in names:
        try:
            profile = load_profile(name)
        except SlambedError as error:
            assert "not found, looked in" in str(error), name
            continue
        assert profile.name == name
        assert profile.description and profile.source, name
        again = parse_profile(json.loads(json.dumps(profile.content)), "again")
        t = np.linspace(0, 100, 50)
        assert np.array_equal(profile.rtt_series_ms(t), again.rtt_series_ms(t)), name


def test_an_experiment_can_set_parameters() -> None:
    mild = parse_profile({"profile": "ramp", "params": {"peak_ms": 30, "rise_s": 4}}, "here")
    assert mild.rtt_ms(4) == 30
    assert mild.name == "ramp[peak_ms=30,rise_s=4]"
    assert parse_profile({"profile": "ramp", "name": "mine"}, "here").name == "mine"
    assert parse_profile("ramp", "here").rtt_ms(9) == 85
    assert parse_profile(25, "here").rtt_ms(3) == 25


def test_impairments_for_both_directions_and_for_one() -> None:
    profile = parse_profile(
        inline(
            10,
            loss={"random": 0.01},
            rate={"mbps": 50},
            up={"loss": None, "jitter": {"sd_ms": 2}},
        ),
        "here",
    )
    assert profile.up.loss is None and profile.down.loss is not None
    assert profile.up.jitter is not None and profile.down.jitter is None
    assert profile.up.rate == profile.down.rate
    assert profile.needs_seed


MISTAKES = [
    (-3, "negative latency -3 ms"),
    (math.nan, "latency is nan"),
    (math.inf, "latency is inf"),
    ("40ms", "expected a number or a curve, not '40ms'"),
    ({"stepz": [[0, 1]]}, "unknown curve 'stepz'.*did you mean 'steps'"),
    ({"steps": [[0, 1], [3, 2], [3, 4]]}, "time goes from 3 s to 3 s"),
    ({"points": [[5, 1], [3, 2]]}, "time goes from 5 s to 3 s"),
    ({"points": [[-1, 1]]}, "time -1 s is negative"),
    ({"points": [[0, math.nan]]}, "finite"),
    ({"steps": [[0, 1], [2, -3]]}, "negative latency -1.5 ms one way at 2.00 s"),
    ({"sine": {"mean_ms": 5, "amplitude_ms": 9, "period_s": 4}}, "negative latency.*clamp"),
    (
        {"sine": {"mean_ms": 10, "amplitude_ms": 50, "period_s": 10000}},
        "negative latency .* at 5321.00 s .*clamp",
    ),
    ({"ramp": {"to_s": 3, "rise_s": 2}}, "unknown key 'to_s'.*did you mean 'to_ms'"),
    ({"ramp": {"to_ms": 3}}, "missing.*ramp.rise_s"),
    ({"sine": {"amplitude_ms": 1, "period_s": 0.01}}, "equal to 0.04"),
    ({"repeat": {"period_s": 0.01, "of": 5}}, "equal to 0.04"),
    ({"points": [[0, 1], [5, True]]}, "not true or false .yes, no, on, off.*points.points.1.1$"),
    ({"scale": {"factor": False, "of": 5}}, "not true or false .*rtt_ms.scale.factor$"),
    ({"clamp": {"min_ms": 9, "max_ms": 3, "of": 5}}, "max_ms 3 is below min_ms 9"),
    ({"sum": []}, "expected a list of curves"),
    ({"sum": 5}, "expected a list of curves, not 5"),
    ([3], "expected a number or one curve, not a list"),
    ({"constant": {"ms": 3}}, "expected milliseconds, not a mapping"),
    ({"sine": {"mean_ms": {"a": 1}}}, "expected a number, not a mapping.*sine.mean_ms"),
    ({"sine": 5}, "expected a mapping of keys, not 5"),
    ({"scale": {"factor": 2}}, "key 'of' is missing"),
    (200_000, r"latency of 100 s .*milliseconds"),
    ("$peak", "unknown parameter '\\$peak'"),
]


@pytest.mark.parametrize(("rtt", "message"), MISTAKES)
def test_a_bad_curve_gets_one_clear_line(rtt: Any, message: str) -> None:
    with pytest.raises(SlambedError, match=message) as caught:
        parse_profile(inline(rtt), "exp.yaml line 7")
    assert "exp.yaml line 7" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"rtt": 3}, "unknown key 'rtt'.*did you mean 'rtt_ms'"),
        ({}, "give one of rtt_ms, one_way_ms"),
        ({"one_way_ms": {"up": 3}}, "expected both up and down"),
        (inline(3, up_share=2), "expected a share 0..1"),
        (inline(3, jitter={"sd_s": 2}), "unknown key 'sd_s'.*did you mean 'sd_ms'"),
        (inline(3, jitter={"shape": "pareto", "sd_ms": 2}), "pareto jitter takes mean_ms"),
        (inline(3, jitter={"sd_ms": 2, "correlation_s": 3601}), "less than or equal to 3600"),
        (
            inline(3, jitter={"shape": "pareto", "mean_ms": 2, "tail": 1.009}),
            "greater than or equal to 1.01",
        ),
        (inline(3, rate={"mbps": 1, "queue_bytes": 10**10 + 1}), "less than or equal to 100000000"),
        (inline(3, loss={"random": 2}), "less than or equal to 1"),
        (inline(3, loss={}), "give one of random, gilbert_elliott"),
        (inline(3, loss={"gilbert_elliott": {"good_s": 5}}), "give good_s and bad_s"),
        (inline(3, loss={"gilbert_elliott": {"to_bad": 0.1}}), "or to_bad and to_good"),
        (
            inline(3, loss={"gilbert_elliott": {"good_s": 5, "bad_s": 1, "to_bad": 0.1}}),
            "give good_s and bad_s",
        ),
        (inline(3, rate={"mbps": 1, "trace": "x"}), "give one of mbps, trace"),
        (inline(3, rate={"trace": "nowhere.up"}), "'nowhere.up' not found"),
        (inline(3, gaps=[{"start_s": 1, "length_s": 2, "every_s": 1}]), "never be there"),
        (inline(3, gap_mode="maybe"), "unknown gap_mode"),
        (inline(3, gap_mode={"a": 1}), "unknown gap_mode a mapping"),
        (inline(3, name=7), "expected text"),
        (inline(3, name={"a": 1}), "expected text, not a mapping.* at name"),
        (inline(3, up_share=[1]), "expected a share 0..1, not a list"),
        (inline(3, jitter={"sd_ms": {"a": 1}}), "expected a number, not a mapping.*jitter.sd_ms"),
        (inline(3, loss=0.1), "expected a mapping of keys, not 0.1"),
        (inline(3, rate={"trace": True}), "expected text, not true"),
        (inline(3, loss={"random": True}), r"expected a number, not true .*loss.random$"),
        (inline(3, rate={"mbps": True}), "expected a number, not true .*rate.mbps$"),
        (inline(3, rate={"mbps": False}), "expected a number, not true .*rate.mbps$"),
        (
            inline(3, loss={"gilbert_elliott": {"to_bad": True, "to_good": 0.5}}),
            "expected a number, not true .*loss.gilbert_elliott.to_bad$",
        ),
        (inline(3, gaps={"a": 1}), "expected a list of gaps, not a mapping"),
        (inline(3, params=5), "expected a mapping of keys, not 5"),
        (inline(3, duration_s=-1), "expected seconds"),
        ("rampp", "unknown profile 'rampp'.*did you mean 'ramp'"),
        ({"profile": "ramp", "params": {"peak": 3}}, "unknown parameter 'peak'"),
        ({"profile": "ramp", "params": {"peak_ms": "high"}}, "expected a number"),
        ({"profile": "ramp", "params": {"peak_ms": {"a": 1}}}, "number, not a mapping.*peak_ms"),
        ({"profile": "ramp", "params": 5}, "expected a mapping of keys, not 5.* at params"),
        ({"profile": {"a": 1}}, "expected text, not a mapping.* at profile"),
        (["ramp"], "expected a profile's name, milliseconds or a mapping, not a list"),
    ],
)
def test_a_bad_profile_gets_one_clear_line(data: Any, message: str) -> None:
    with pytest.raises(SlambedError, match=message) as caught:
        parse_profile(data, "exp.yaml line 7")
    assert "\n" not in str(caught.value)


def test_a_bad_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("rtt_ms: {ramp: {to_ms: -5, rise_s: 1}}\n")
    with pytest.raises(SlambedError, match=r"negative latency.*mine\.yaml"):
        load_profile(path)
    path.write_text("rtt_ms: [1\n")
    with pytest.raises(SlambedError, match=r"not YAML.*mine\.yaml"):
        load_profile(path)


@pytest.mark.parametrize(
    ("written", "advice"),
    [
        ({"loss": 0.01}, "write 'loss: {random: 0.01}'"),
        ({"rate": 5}, "write 'rate: {mbps: 5}'"),
        ({"up": {"jitter": 3}}, "write 'jitter: {sd_ms: 3}'"),
    ],
)
def test_a_number_for_an_impairment_is_told_how_to_be_written(
    written: dict[str, Any], advice: str
) -> None:
    with pytest.raises(SlambedError, match="expected a mapping of keys") as error:
        parse_profile({"rtt_ms": 5, **written}, "x.yaml")
    assert str(error.value).endswith(advice)
    ((kind, number),) = written.get("up", written).items()
    parse_profile({"rtt_ms": 5, kind: {advice.split("{")[1].split(":")[0]: number}}, "x.yaml")


def test_a_loss_that_is_hardly_meant_is_a_remark() -> None:
    (line,) = parse_profile({"rtt_ms": 5, "up": {"loss": {"random": 1}}}, "x.yaml").remarks
    assert line == "100% of packets up are lost; 0.01 is 1 %"
    assert not parse_profile({"rtt_ms": 5, "loss": {"random": 0.5}}, "x.yaml").remarks


def test_outages_of_a_kept_profile_are_read_without_its_traces() -> None:
    gaps = [{"start_s": 2, "length_s": 1, "every_s": 5}, {"start_s": 9.5, "length_s": 2}]
    content = {"rtt_ms": {"trace": {"file": "not/here.csv"}}, "gaps": gaps}
    assert outages_within(content, 10.0) == [(2, 3), (7, 8), (9.5, 11.5)]
    assert outages_within({"rtt_ms": 5}, 10.0) == []
    assert outages_within({"gaps": [{"start_s": "soon"}]}, 10.0) == []


def test_a_profile_beside_the_experiment_is_named_by_its_path(tmp_path: Path) -> None:
    (tmp_path / "hall.yaml").write_text("rtt_ms: 5\n")
    with pytest.raises(SlambedError, match=r"unknown profile 'hall', x\.yaml") as error:
        parse_profile("hall", "x.yaml", tmp_path)
    assert str(error.value).endswith("write ./hall.yaml")
