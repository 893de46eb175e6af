import pickle
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from simulators import BOWL, bowl, slow_campaign

import pitchline
from pitchline.simulate import Simulator


def test_a_function_is_simulated_to_its_optimum(finished):
    assert finished.finished
    best = finished.recommended
    # The 90th percentile of normal noise of 0.1 at the bottom of the bowl is 0.128.
    assert [best["x"], best["y"]] == pytest.approx([0.5, -0.5], abs=0.25)
    assert best["p90_low"] < best["p90"] < best["p90_high"]
    assert best["p90"] < 0.35


def test_an_exception_is_a_refusal_with_its_text(finished):
    designs = finished.table("designs")
    far = designs["x"] > 1.7
    assert 0 < far.sum() < len(designs)
    for is_far, reason in zip(far, designs["reason"], strict=True):
        assert ("value-error" in reason) == is_far


def test_tables_are_arrow_for_all_that_read_it(finished):
    import duckdb
    import pandas
    import polars
    import pyarrow

    rows = finished.table("samples")
    assert rows.columns == ["design", "sample", "depth"]
    assert rows.units == {"depth": "mm"}
    arrow = pyarrow.table(rows)
    assert arrow.schema.field("depth").metadata == {b"unit": b"mm"}
    assert arrow.num_rows == len(rows) > 0
    frames = pandas.DataFrame.from_arrow(rows), polars.DataFrame(rows)
    for frame in frames:
        assert np.array_equal(frame["depth"].to_numpy(), rows["depth"])
        assert frame["design"].to_numpy().dtype == np.int64
    assert duckdb.sql("SELECT count(*) FROM rows").fetchall() == [(len(rows),)]
    # Without a copy: a second reading is of the same memory.
    again = pyarrow.table(rows)
    assert again["depth"].chunk(0).buffers()[1].address == arrow["depth"].chunk(0).buffers()[1].address
    with pytest.raises(KeyError, match="depth"):
        rows["height"]
    with pytest.raises(pitchline.PitchlineError, match="designs, samples"):
        finished.table("rows")


def test_every_table_is_there(finished):
    for name in ["designs", "samples", "responses", "loo", "optima", "rounds", "infill", "evaluations", "failures", "blocks"]:
        table = finished.table(name)
        assert all(len(table[column]) == len(table) for column in table.columns)


def test_the_model_predicts_and_is_pickled(finished):
    model = finished.model
    assert model.input_names_ == ["x", "y"]
    mean, sd = model.predict([[0.5, -0.5]], return_std=True)
    assert abs(mean[0] - 0.128) < 4.0 * sd[0] + 0.1
    assert pickle.loads(pickle.dumps(model)).predict([[0.5, -0.5]]) == mean


def test_jupyter_shows_status_tables_and_report(finished, tmp_path):
    assert "P90" in finished._repr_html_()
    assert "<th>depth, mm</th>" in finished.table("samples")._repr_html_()
    report = finished.report(tmp_path / "report")
    assert report.page.exists()
    assert "<iframe" in report._repr_html_()
    chart = report.charts["distribution-histogram"]
    assert chart._repr_svg_().startswith("<svg")


def test_the_same_call_goes_on_with_what_is_there(finished, tmp_path):
    seen = []
    campaign = pitchline.Campaign(BOWL, simulator=bowl)
    again = campaign.run(finished.db, out=finished.db.with_name("report"), progress=seen.append)
    assert again.status["samples_digest"] == finished.status["samples_digest"]
    assert seen[-1]["finished"]
    assert str(campaign) == "<Campaign bowl>"


def test_wrong_campaigns_are_explained_and_nothing_is_left(tmp_path):
    wrong = {**BOWL, "doe": {"designs": 0}}
    campaign = pitchline.Campaign(wrong, simulator=bowl)
    with pytest.raises(pitchline.CampaignError, match=r"^the campaign, line \d+: .*designs") as error:
        campaign.run(tmp_path / "wrong.db", progress=False)
    assert error.value.code == 3
    assert error.value.results is None
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(pitchline.CampaignError, match="designs"):
        campaign.check()
    checked = pitchline.Campaign(BOWL, simulator=lambda x, y, rng: x).check()
    assert (checked["campaign"], checked["file"]) == ("bowl", "the campaign")
    with pytest.raises(pitchline.PitchlineError, match="no store|there is no"):
        pitchline.Results(tmp_path / "none.db")


def test_a_campaign_without_a_feasible_design_says_so_and_keeps_its_results(tmp_path):
    @pitchline.simulator
    def nothing(x, y, rng):
        raise pitchline.Refused("the sea is rough")

    with pytest.raises(pitchline.CampaignError) as error:
        pitchline.Campaign(BOWL, simulator=nothing).run(tmp_path / "a.db", out=tmp_path / "r", progress=False)
    assert error.value.code in (15, 16)
    reasons = set(error.value.results.table("designs")["reason"])
    assert reasons == {"refused: the sea is rough"}


def test_ctrl_c_stops_in_order_and_the_same_call_continues(tmp_path, finished):
    db, out = tmp_path / "a.db", tmp_path / "report"
    program = slow_campaign(db, out, seconds=0.02)
    child = subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 120.0
    while time.monotonic() < deadline:
        time.sleep(0.1)
        if db.exists() and pitchline.Results(db).status["samples"]["done"] > 20:
            break
    child.send_signal(signal.SIGINT)
    said = child.communicate(timeout=60.0)[1]
    assert "KeyboardInterrupt" in said
    kept = pitchline.Results(db).status["samples"]["done"]
    assert 20 < kept < finished.status["samples"]["done"]
    done = pitchline.Campaign(BOWL, simulator=bowl).run(db, out=out, progress=False)
    assert done.status["samples_digest"] == finished.status["samples_digest"]


def test_questions_are_asked_and_told(tmp_path):
    # Without the part in which the function refuses.
    near = {**BOWL, "variables": [{**one, "high": 1.6} for one in BOWL["variables"]]}
    expected = pitchline.Campaign(near, simulator=bowl).run(
        tmp_path / "b.db", out=tmp_path / "b", workers=2, progress=False
    )
    campaign = pitchline.Campaign({**near, "simulator": {"probe_designs": 0}})
    asked = 0

    def tell(request):
        rng = np.random.default_rng(request.seed)
        request.tell(depth=bowl(request.design["x"], request.design["y"], rng))

    # Stopped in the middle, and continued with several questions at once.
    with campaign.ask_and_tell(tmp_path / "a.db", out=tmp_path / "report") as evaluations:
        for request in evaluations:
            tell(request)
            asked += 1
            if asked == 40:
                break
    with campaign.ask_and_tell(tmp_path / "a.db", parallel=3, out=tmp_path / "report") as evaluations:
        for request in evaluations:
            tell(request)
        results = evaluations.results()
    assert results.status["samples_digest"] == expected.status["samples_digest"]
    assert results.recommended == {**expected.recommended, "cpu_seconds": results.recommended["cpu_seconds"]}


def test_a_wrong_answer_is_refused_where_it_is_told(tmp_path):
    campaign = pitchline.Campaign({**BOWL, "simulator": {"probe_designs": 0}})
    with campaign.ask_and_tell(tmp_path / "a.db") as evaluations:
        request = evaluations.ask()
        with pytest.raises(pitchline.PitchlineError, match="it must be"):
            request.tell(height=1.0)


def test_an_answer_may_have_no_number_or_a_reason(tmp_path):
    few = {**BOWL, "doe": {"designs": 4}, "sampling": {"samples_per_design": 4}, "simulator": {"probe_designs": 0}}
    few["constraints"] = [{"name": "length", "max": 10.0}]
    asked = set()
    with pitchline.Campaign(few).ask_and_tell(tmp_path / "a.db", parallel=2, out=tmp_path / "report") as evaluations:
        for request in evaluations:
            question = (request.kind, request.design["x"], request.design["y"], request.seed)
            assert question not in asked
            asked.add(question)
            if request.kind == "sample":
                request.tell(depth=float("nan"))
            elif request.design["x"] < -1.0:
                request.refuse("the sea reached Infinity")
            elif request.design["x"] > 1.0:
                request.refuse("gap: NaN")
            else:
                request.tell(length=1.0)
            with pytest.raises(pitchline.PitchlineError, match="answered already"):
                request.again("no licence")
        with pytest.raises(pitchline.CampaignError) as error:
            evaluations.results()
    designs = error.value.results.table("designs")
    assert set(designs["reason"]) == {"refused: the sea reached Infinity", "gap: NaN", ""}
    assert len(error.value.results.table("failures")) == 0
    samples = error.value.results.table("samples")["depth"]
    assert len(samples) > 0
    assert np.isinf(samples).all()


def test_a_coordinator_elsewhere_is_asked_and_worked_for(tmp_path, finished):
    access = tmp_path / "bowl.access"
    near = {**BOWL, "name": "far"}
    campaign = tmp_path / "far.toml"
    campaign.write_text(pitchline.Campaign(near).text)
    options = ["--db", tmp_path / "far.db", "--out", tmp_path / "report", "--access", access]
    options += ["--listen", "127.0.0.1:0", "--keep-serving"]
    serve = [pitchline.program("coordinator"), "serve", campaign, *options]
    with subprocess.Popen(serve, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as server:
        try:
            deadline = time.monotonic() + 60.0
            while not access.exists() and time.monotonic() < deadline:
                time.sleep(0.05)
            far = pitchline.Coordinator(access)
            assert far.status()["campaign"] == "far"
            assert all(sentence[0].islower() and " " in sentence for sentence in far.explain())
            assert "<table>" in far._repr_html_()
            far.drain(resume=True)
            far.retry()
            pitchline.work(bowl, access=access, slots=2)
            while not far.status()["finished"] and time.monotonic() < deadline:
                time.sleep(0.05)
            far.drain()
            assert server.wait(60.0) == 0
        finally:
            server.kill()
    assert pitchline.Results(tmp_path / "far.db").finished
    with pytest.raises(pitchline.PitchlineError):
        far.status()


def test_arguments_are_passed_by_their_names():
    def describe(simulator):
        simulator.answer(
            {"request": "describe", "protocol": 2, "responses": ["length"], "sampled": ["depth"], "variables": []}
        )
        return simulator

    design = {"x": 1.0, "y": 2.0}
    sample = {"request": "sample", "design": design, "seed": [1, 2, 0, 0]}
    evaluate = {"request": "evaluate", "design": design, "responses": ["length"]}

    everything = describe(Simulator(lambda **all: {"depth": all["x"], "length": len(all)}))
    assert everything.answer(sample) == {"depth": 1.0}
    assert everything.answer(evaluate) == {"length": 2.0}
    seeded = describe(Simulator(lambda y, seed: y + (seed or 0)))
    assert seeded.answer(sample) == {"depth": 2.0 + 1 + (2 << 32)}
    missing = describe(Simulator(lambda x: {"other": x}))
    assert missing.answer(sample) == {"refused": "type-error: the simulator returned ['other'], without ['depth']"}
    assert describe(Simulator(lambda x: float("nan"))).answer(sample) == {"depth": None}

    def licence(x):
        raise pitchline.Again("no licence")

    assert describe(Simulator(licence)).answer(sample) == {"error": "no licence"}
    with pytest.raises(TypeError, match="by their names"):
        pitchline.simulator(lambda *x: 0.0)
