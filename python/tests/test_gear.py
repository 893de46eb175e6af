import pickle
from pathlib import Path

import numpy as np
import pytest

import pitchline
from pitchline import doe
from pitchline.gear import Designs, Pair

CAMPAIGNS = Path(__file__).resolve().parents[2] / "campaigns"

PAIR = {
    "pair": {
        "teeth": [23, 47],
        "normal_module_mm": 3.0,
        "pressure_angle_deg": 20.0,
        "helix_angle_deg": 15.0,
        "face_width_mm": 30.0,
        "profile_shift": np.array([0.3, 0.1]),
        "rack": "iso-53-a",
        "tip_radius_mm": [0.0, 0.0],
    },
    "load": {"pinion_torque_nm": np.float64(350.0)},
    "material": {"name": "16MnCr5"},
}

@pytest.fixture(scope="module")
def pair():
    return Pair(**PAIR)


@pytest.fixture(scope="module")
def designs():
    return Designs(CAMPAIGNS / "pair.toml")


def test_the_geometry_has_the_symbols_of_iso_21771(pair):
    of = pair.geometry
    assert list(of["z"]) == [23, 47]
    # d = z m_n / cos β
    assert of["d"] == pytest.approx([z * 3.0 / np.cos(np.radians(15.0)) for z in (23, 47)])
    assert of["d_b"][0] == pytest.approx(of["d"][0] * np.cos(np.radians(of["alpha_t"])))
    assert 1.3 < of["epsilon_alpha"] < 1.8
    assert "23/47" in repr(pair)
    assert "epsilon_beta" in pair._repr_html_()


def test_the_curve_is_that_of_the_program(pair):
    curve = pair.transmission_error()
    told = pair.simulate()
    assert curve.delta_ste_um == pytest.approx(told["delta_ste_um"], rel=1e-12)
    worn = pair.transmission_error(worn=True)
    assert worn.delta_ste_um == pytest.approx(pair.simulate(wear="archard")["delta_ste_um"], rel=1e-12)
    assert worn.delta_ste_um != curve.delta_ste_um


def test_a_sample_depends_on_its_number_and_the_seed_alone(pair):
    samples = pair.sample(200, seed=3)
    assert samples.shape == (200, 1)
    assert (pair.sample(70, seed=3) == samples[:70]).all()
    assert not (pair.sample(70, seed=4) == samples[:70]).any()


def test_samples_are_those_of_the_program(pair):
    told = pair.simulate(wear="random", samples=40, seed=3)
    assert told["samples_um"] == pair.sample(40, seed=3)[:, 0].tolist()


def test_a_pair_survives_pickle_and_its_file(pair, tmp_path):
    again = pickle.loads(pickle.dumps(pair))
    assert (again.sample(10) == pair.sample(10)).all()
    file = tmp_path / "pair.toml"
    file.write_text(pair.to_toml())
    assert (Pair.from_toml(file).sample(10) == pair.sample(10)).all()


def test_what_is_no_pair_is_refused_in_the_words_of_the_program():
    with pytest.raises(pitchline.PitchlineError, match="missing field `material`"):
        Pair(pair=PAIR["pair"], load=PAIR["load"])
    with pytest.raises(pitchline.PitchlineError, match="wear"):
        Pair(**PAIR).simulate(wear="some")
    apart = {**PAIR, "pair": {**PAIR["pair"], "centre_distance_mm": 130.0}}
    with pytest.raises(pitchline.PitchlineError, match="^[a-z-]+: "):
        Pair(**apart)


def test_many_designs_are_computed_at_once(designs):
    x = designs.from_unit(doe.maximin(40, len(designs.variables), seed=2, effort=0.1))
    assert ((designs.bounds[:, 0] <= x) & (x <= designs.bounds[:, 1])).all()
    responses = designs.evaluate(x)
    refused = [reason is not None for reason in responses.refused]
    assert len(responses.values) == len(designs.responses)
    for values in responses.values.values():
        assert (np.isnan(values) == refused).all()
    samples = designs.sample(x[:4], 6, seed=9)
    assert samples.values.shape == (4, 6, len(designs.sampled))
    # Each design has a stream of its own.
    alone = designs.sample(x[2:3], 6, seed=9, first=2)
    assert (alone.values[0] == samples.values[2]).all()
    again = pickle.loads(pickle.dumps(designs)).sample(x[:4], 6, seed=9)
    assert (again.values == samples.values).all()


def test_a_campaign_can_be_a_dictionary():
    tomllib = pytest.importorskip("tomllib")
    sections = tomllib.loads((CAMPAIGNS / "pair.toml").read_text(encoding="utf-8"))
    sections["bounds"]["profile_shift"]["pinion"] = np.array([-0.05, 0.55])
    designs = Designs(sections)
    assert len(designs.variables) == len(designs.bounds)
    assert [-0.05, 0.55] in designs.bounds.tolist()
    assert designs.variables["tip_relief_p_um"] == "µm"
    assert designs.warnings == []
    with pytest.raises(pitchline.PitchlineError, match="must have"):
        designs.evaluate([[0.0]])
    with pytest.raises(pitchline.PitchlineError, match='must be "gear"'):
        Designs(CAMPAIGNS / "ishigami/campaign.toml")


def test_the_optimum_of_a_campaign_is_a_pair(tmp_path):
    tomllib = pytest.importorskip("tomllib")
    sections = tomllib.loads((CAMPAIGNS / "quick.toml").read_text(encoding="utf-8"))
    campaign = pitchline.Campaign(sections)
    results = campaign.run(tmp_path / "quick.db", out=tmp_path / "report", progress=False)
    pair = results.pair()
    assert pair.simulate()["feasible"]
    assert list(pair.geometry["z"]) == list(results.pair("best-of-doe").geometry["z"])
    with pytest.raises(pitchline.PitchlineError, match="there is no approach"):
        results.pair("luck")
