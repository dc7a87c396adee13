"""That the figures hold what they are given: every run, every edge, every branch."""

import re
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from compensation.bifurcation import Branch, Point
from ident.model.friction import StribeckCurve
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot
from pipelines.report.bifurcation_figures import branch_arrays, figure9
from pipelines.report.comparison_figure import figure10
from pipelines.report.equilibrium_figures import figure4, figure8
from pipelines.report.friction_figures import figure2
from pipelines.report.onset_panel import start_label
from pipelines.report.style import svg_text
from pipelines.report.time_figures import figure6, figure7
from pipelines.report.validation_figure import validation_figure
from tests.pipelines.report import examples


def _marks(axes: Axes, marker: str) -> list[Line2D]:
    return [line for line in axes.lines if line.get_marker() == marker]


def _labels(text: str) -> list[str]:
    return re.findall(r"<!-- (.*?) -->", text)


def _curves(robot: OneLinkRobot) -> dict[int, StribeckCurve]:
    return {1: robot.friction.positive, -1: robot.friction.negative}


class TestFigure2:
    def test_holds_every_measurement_in_both_panels(self) -> None:
        points = examples.map_points()
        whole, slow = figure2(points, _curves(asymmetric_robot())).axes
        for marker, protocol in (("o", "constant_velocity"), ("D", "breakaway")):
            wanted = [(p.velocity, p.torque) for p in points if p.protocol == protocol]
            drawn = [tuple(np.ravel(mark.get_xydata())) for mark in _marks(whole, marker)]
            assert drawn == wanted
        assert len(_marks(slow, "D")) == 2
        assert len(_marks(slow, "o")) == 4  # 1.5 rad/s lies beyond the Stribeck part

    def test_a_run_left_out_is_hollow(self) -> None:
        whole = figure2(examples.map_points(), {}).axes[0]
        hollow = [mark for mark in _marks(whole, "o") if mark.get_markerfacecolor() == "none"]
        assert sorted(float(np.ravel(mark.get_xdata())[0]) for mark in hollow) == [-0.006, 0.006]

    def test_the_model_is_the_friction_law_and_spans_the_stiction_interval(self) -> None:
        robot = asymmetric_robot()
        lines = [
            line
            for line in figure2(examples.map_points(), _curves(robot)).axes[0].lines
            if line.get_marker() == "None"
        ]
        curves = [line for line in lines if len(np.ravel(line.get_xdata())) > 100]
        speed, torque = np.asarray(curves[1].get_xydata()).T
        np.testing.assert_allclose(torque, -robot.friction.negative.total(-speed), rtol=1e-12)
        rest = next(
            line for line in lines if np.ptp(np.ravel(line.get_ydata())) > 1 and not np.any(line.get_xdata())
        )
        assert sorted(np.ravel(rest.get_ydata())) == [-0.5123, 0.5735]

    def test_a_direction_that_is_known_alone_is_drawn_alone(self) -> None:
        curve = asymmetric_robot().friction.negative
        lines = [
            line for line in figure2([], {-1: curve}).axes[0].lines if len(np.ravel(line.get_xdata())) > 9
        ]
        assert [float(np.max(np.ravel(line.get_xdata()))) < 0 for line in lines] == [True]

    def test_draws_what_there_is(self) -> None:
        assert len(figure2([], {}).axes) == 2
        assert len(figure2([], _curves(symmetric_robot())).axes) == 2
        assert len(figure2(examples.map_points()[:1], {}).axes) == 2

    def test_units_follow_the_axis(self) -> None:
        labels = " ".join(_labels(svg_text(figure2([], {}, axis="linear"))))
        assert "velocity [m/s]" in labels
        assert "force [N]" in labels


class TestFigures4And8:
    def test_the_critical_gain_is_written_down(self) -> None:
        gain = np.linspace(20, 120, 5)
        edges = np.column_stack((-gain, gain)) / 200
        assert any(
            "73.07" in label
            for label in _labels(svg_text(figure4(gain, edges, edges, critical_gain=73.0704)))
        )
        assert not any(
            "L_c" in label for label in _labels(svg_text(figure4(gain, edges, edges, critical_gain=None)))
        )

    def test_every_gain_has_its_own_colour_and_name(self) -> None:
        gain = np.linspace(20, 120, 5)
        edges = {r: np.column_stack((gain, 0 * gain)) for r in (0.9, 0.95, 0.99, 1.0, 1.005, 1.01)}
        figure = figure8(gain, edges, critical_gain=73.07)
        legend = figure.legends[0]
        assert [text.get_text() for text in legend.get_texts()] == [f"$r$ = {r:g}" for r in edges]
        assert len({line.get_color() for line in legend.get_lines()}) == len(edges)

    def test_an_inner_edge_is_drawn_only_where_there_is_one(self) -> None:
        gain = np.linspace(20, 120, 5)
        inner = np.array([0.1, 0.1, 0.0, np.nan, np.nan])
        axes = figure8(gain, {1.01: np.column_stack((gain, inner))}, critical_gain=None).axes[0]
        dashed = [line for line in axes.lines if line.get_linestyle() == "--"]
        assert len(dashed) == 1
        np.testing.assert_array_equal(np.isfinite(dashed[0].get_ydata()), [True, True, False, False, False])

    def test_gains_that_are_spread_by_ratios_are_drawn_so(self) -> None:
        for gain, scale in ((np.linspace(1.0, 100.0, 50), "linear"), (np.geomspace(1.0, 1e6, 50), "log")):
            curve = np.column_stack((-1.0 / gain, 1.0 / gain))
            assert figure8(gain, {1.0: curve}, critical_gain=None).axes[0].get_xscale() == scale
            assert figure4(gain, curve, curve, critical_gain=None).axes[0].get_xscale() == scale

    def test_a_pole_at_small_gains_does_not_hide_the_rest(self) -> None:
        gain = np.linspace(1.0, 100.0, 100)
        curve = np.column_stack((-1e4 * gain**-6.0, 2e4 * gain**-6.0 + 1.0))
        assert figure8(gain, {1.0: curve}, critical_gain=None).axes[0].get_ylim()[1] < 4.0
        assert figure4(gain, curve, curve, critical_gain=None).axes[0].get_ylim()[1] < 4.0


class TestFigures6And7:
    def test_the_perturbation_is_named(self) -> None:
        motion = examples.motion()
        labels = _labels(svg_text(figure6(motion, motion, perturbation="r = 1.0001 instead of 1")))
        assert any("r = 1.0001 instead of 1" in label for label in labels)
        assert any("exact solution" in label for label in labels)

    def test_the_velocity_is_the_estimate_and_its_error(self) -> None:
        motion = examples.motion()
        panels = figure7(motion, torque=np.sin(motion.time)).axes
        assert len(panels) == 4
        drawn = [
            np.asarray(line.get_ydata()) for line in panels[1].lines if len(np.ravel(line.get_ydata())) > 2
        ]
        np.testing.assert_array_equal(drawn[0], motion.state[:, 1] + motion.state[:, 2])
        np.testing.assert_array_equal(drawn[1], motion.state[:, 1])
        assert len(figure7(motion).axes) == 3


class TestFigure9:
    def test_names_the_branches_as_the_paper_does(self) -> None:
        labels = " ".join(_labels(svg_text(figure9(examples.diagram()))))
        for name in (
            "(I)",
            "(II)",
            "(III)",
            "stable limit cycle",
            "equilibrium set",
            "unstable equilibrium point",
        ):
            assert name in labels
        assert "r = 1" in labels

    def test_a_branch_without_points_is_four_empty_columns(self) -> None:
        value, low, high, amplitude = branch_arrays(examples.diagram().branches[1].points)
        assert value.shape == low.shape == high.shape == (7,)
        np.testing.assert_array_equal(amplitude, value - 1)
        assert [column.shape for column in branch_arrays(())] == [(0,)] * 4

    def test_an_empty_diagram_is_still_a_picture(self) -> None:
        empty = replace(examples.diagram(), branches=(Branch("limit_cycle", True, ()),), bifurcations=())
        assert not figure9(empty).axes[0].lines[1:-1]

    def test_a_set_that_is_one_point_is_seen(self) -> None:
        point = Branch("equilibrium", True, (Point(1.0, 0.0, 0.0, 0.0),))
        marks = _marks(figure9(replace(examples.diagram(), branches=(point,))).axes[0], "o")
        assert [float(np.ravel(mark.get_xdata())[0]) for mark in marks] == [1.0]

    def test_a_cycle_at_one_value_only_is_seen(self) -> None:
        one = Branch("limit_cycle", True, (Point(1.1, -0.3, 0.3, 0.3),))
        span = Branch("equilibrium_set", True, (Point(0.9, -0.2, 0.1, 0.2),))
        marks = _marks(figure9(replace(examples.diagram(), branches=(one, span))).axes[0], "o")
        assert sorted(float(np.ravel(mark.get_ydata())[0]) for mark in marks) == [-0.2, 0.1, 0.3]


class TestFigure10:
    def test_holds_every_run_by_its_verdict(self) -> None:
        comparison = examples.comparison()
        main = figure10(comparison, fitted=examples.diagram(), symmetric=examples.diagram()).axes[0]
        for verdict, marker in (("equilibrium", "*"), ("limit_cycle", "o"), ("undecided", "^")):
            wanted = sorted(run["r"] for run in comparison["runs"] if run["verdict"] == verdict)
            assert sorted(float(np.ravel(mark.get_xdata())[0]) for mark in _marks(main, marker)) == wanted
        assert len(_marks(main, "_")) == len(comparison["runs"])  # each with its prediction

    def test_rests_stand_at_their_error_and_cycles_at_their_amplitude(self) -> None:
        main = figure10(examples.comparison()).axes[0]
        assert {float(np.ravel(mark.get_ydata())[0]) for mark in _marks(main, "*")} == {0.2}
        heights = [
            (float(np.ravel(m.get_xdata())[0]), float(np.ravel(m.get_ydata())[0])) for m in _marks(main, "o")
        ]
        for r, height in heights:
            assert height == r - 0.9

    def test_onsets_have_a_row_for_each_start(self) -> None:
        strip = figure10(examples.comparison()).axes[1]
        assert [tick.get_text() for tick in strip.get_yticklabels()] == ["from +0.6 rad", "from −0.1 rad"]
        predicted = [float(np.ravel(m.get_xdata())[0]) for m in _marks(strip, "D")]
        assert sorted(predicted) == [0.993, 0.995]
        assert [float(np.ravel(m.get_xdata())[0]) for m in _marks(strip, "*")] == [1.15]

    def test_gains_that_all_runs_share_stand_above(self) -> None:
        comparison = examples.comparison()
        assert any("L = 73.5 1/s" in label for label in _labels(svg_text(figure10(comparison))))
        comparison["onset"][0]["gains"] = {"observer_gain": 40.0}
        labels = _labels(svg_text(figure10(comparison)))
        assert not any("L = 73.5 1/s" in label for label in labels)
        assert any("observer_gain 40" in label for label in labels)

    def test_a_run_has_the_colour_of_the_start_that_it_belongs_to(self) -> None:
        comparison = examples.comparison()
        for k, run in enumerate(comparison["runs"]):
            run["start"] += 1e-3 * k  # as measured
        main, strip = figure10(comparison).axes
        colours = {str(mark.get_markerfacecolor()) for mark in _marks(main, "*")}
        assert len(colours) == 2
        assert {str(mark.get_color()) for mark in _marks(strip, "|")} == colours

    def test_no_runs_or_no_onsets_are_no_failure(self) -> None:
        assert len(figure10({"runs": [], "onset": []}).axes) == 1
        assert len(figure10({"runs": examples.comparison()["runs"]}).axes) == 1
        nothing = dict.fromkeys(("recorded", "predicted", "ideal", "symmetric", "reversals"))
        figure10({"runs": [], "onset": [{"start": 0.1, "gains": None, **nothing}]})


def test_a_start_is_named_by_its_position() -> None:
    assert start_label([0.6, 0.0, 0.0]) == start_label(0.6) == "+0.6"
    assert start_label("a\x1bb") == "a\\x1bb"


class TestValidation:
    def test_holds_every_held_out_run_over_speed_and_over_place(self) -> None:
        held_out = examples.held_out()
        over_speed, over_place = validation_figure(held_out).axes
        for axes, variable in ((over_speed, "velocity"), (over_place, "place")):
            drawn = sorted(tuple(np.ravel(mark.get_xydata())) for kind in "oD" for mark in _marks(axes, kind))
            across = abs if variable == "velocity" else float
            wanted = sorted((across(p[variable]), p["standardised"]) for p in held_out["points"])
            assert drawn == wanted
            assert axes.get_ylim()[1] > 4.2
        assert len(_marks(over_speed, "D")) == 2

    def test_is_drawn_without_a_run_that_moves(self) -> None:
        held_out = examples.held_out()
        still = [point for point in held_out["points"] if not point["velocity"]]
        assert len(validation_figure({**held_out, "points": still}).axes) == 2
