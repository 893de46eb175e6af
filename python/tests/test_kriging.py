import pickle
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern
from sklearn.model_selection import cross_val_score
from sklearn.utils.estimator_checks import parametrize_with_checks

from pitchline import PitchlineError, doe
from pitchline.kriging import Kriging


# No check is left out; that of array libraries other than numpy skips itself.
@parametrize_with_checks([Kriging()])
def test_it_is_an_estimator_of_scikit_learn(estimator, check):
    check(estimator)


@pytest.fixture(scope="module")
def table():
    rng = np.random.default_rng(2)
    x = doe.maximin(60, 2, seed=4)
    truth = np.sin(5.0 * x[:, 0]) * np.cos(3.0 * x[:, 1])
    noise_variance = rng.uniform(0.001, 0.01, size=60)
    return x, truth + rng.normal(size=60) * np.sqrt(noise_variance), noise_variance


@pytest.fixture(scope="module")
def model(table):
    x, y, noise_variance = table
    return Kriging(kernel="radial-matern-5-2").fit(x, y, noise_variance=noise_variance)


def test_predictions_are_those_of_scikit_learn_with_the_same_parameters(table, model):
    x, y, noise_variance = table
    kernel = ConstantKernel(model.variance_, "fixed") * Matern(model.ranges_, "fixed", nu=2.5)
    peer = GaussianProcessRegressor(kernel, alpha=noise_variance, optimizer=None).fit(x, y - model.mean_)
    at = doe.sobol(50, 2, seed=8)
    mean, sd = model.predict(at, return_std=True)
    expected, expected_sd = peer.predict(at, return_std=True)
    assert mean == pytest.approx(expected + model.mean_, abs=1e-9)
    # Ours includes the variance of the estimated mean.
    assert (sd > expected_sd - 1e-9).all()
    assert sd == pytest.approx(expected_sd, rel=0.05)


def test_gradients_are_the_limits_of_differences(model):
    at = doe.sobol(20, 2, seed=5)
    gradient = model.gradient(at)
    for j in range(2):
        step = np.zeros(2)
        step[j] = 1e-5
        difference = (model.predict(at + step) - model.predict(at - step)) / 2e-5
        assert gradient[:, j] == pytest.approx(difference, abs=1e-4)


def test_draws_have_the_predicted_moments(model):
    at = doe.sobol(6, 2, seed=5)
    mean, covariance = model.predict(at, return_cov=True)
    draws = model.sample_y(at, 20_000, random_state=3)
    assert draws.shape == (6, 20_000)
    assert draws.mean(axis=1) == pytest.approx(mean, abs=4.0 * np.sqrt(covariance.max() / 20_000))
    assert np.cov(draws) == pytest.approx(covariance, abs=0.05 * covariance.max())
    _, sd = model.predict(at, return_std=True)
    assert np.sqrt(np.diag(covariance)) == pytest.approx(sd, rel=1e-6)


def test_intervals_widen_with_the_noise_of_an_observation(model):
    at = doe.sobol(10, 2, seed=5)
    mean, sd = model.predict(at, return_std=True)
    function = model.interval(at, 0.95)
    observation = model.interval(at, 0.95, noise_variance=0.01)
    assert function.high - function.low == pytest.approx(2 * 1.959964 * sd, rel=1e-5)
    assert (observation.low < function.low).all()
    assert (observation.high > function.high).all()
    assert model.quantile(at, 0.5) == pytest.approx(mean)


def test_a_model_of_logarithms_stays_positive():
    x = np.linspace(0.0, 1.0, 25)[:, None]
    y = np.exp(4.0 * np.sin(5.0 * x[:, 0]))
    model = Kriging(response="log").fit(x, y, noise_variance=1e-6 * y**2)
    at = np.linspace(0.0, 1.0, 7)[:, None]
    truth = np.exp(4.0 * np.sin(5.0 * at[:, 0]))
    assert model.predict(at) == pytest.approx(truth, rel=0.02)
    mean, covariance = model.predict(at, return_cov=True)
    _, sd = model.predict(at, return_std=True)
    assert np.sqrt(np.diag(covariance)) == pytest.approx(sd, rel=1e-3, abs=1e-9)
    assert (model.sample_y(at, 10) > 0.0).all()


def test_the_approximate_method_says_what_it_cannot(table):
    x, y, noise_variance = table
    model = Kriging(method="vecchia").fit(x, y, noise_variance=noise_variance)
    mean, sd = model.predict(x, return_std=True)
    assert np.corrcoef(mean, y)[0, 1] > 0.98
    assert (sd > 0.0).all()
    for call in (model.gradient, model.sample_y, lambda x: model.predict(x, return_cov=True)):
        with pytest.raises(ValueError, match="exact"):
            call(x)


@settings(max_examples=20)
@given(
    st.sampled_from(["matern-5-2", "squared-exponential", "exponential", "radial-matern-3-2"]),
    st.sampled_from(["constant", "linear"]),
    st.integers(0, 1000),
)
def test_a_pickled_model_predicts_the_same_bits(kernel, trend, seed):
    x = doe.random(25, 2, seed=seed)
    model = Kriging(kernel=kernel, trend=trend, starts=2).fit(x, np.sin(3.0 * x[:, 0]) + x[:, 1])
    again = pickle.loads(pickle.dumps(model))
    at = doe.sobol(8, 2)
    assert (again.predict(at) == model.predict(at)).all()
    assert again.get_params() == model.get_params()
    assert pickle.loads(pickle.dumps(Kriging(kernel=kernel))).kernel == kernel


def test_it_takes_part_in_cross_validation(table):
    x, y, _ = table
    assert cross_val_score(Kriging(starts=3), x, y, cv=4).min() > 0.8


def test_leave_one_out_is_measured(table, model):
    found = model.leave_one_out()
    assert len(found.residuals) == 60
    assert found.q2 > 0.9
    assert found.rmse == pytest.approx(np.sqrt(np.mean(found.residuals**2)))
    assert 0.75 < found.coverage_90 <= 1.0


def test_wrong_settings_are_named(table):
    x, y, _ = table
    with pytest.raises(PitchlineError, match="kernel is 'gauss'|kernel is \"gauss\""):
        Kriging(kernel="gauss").fit(x, y)
    with pytest.raises(PitchlineError):
        Kriging().fit(x, y, noise_variance=-1.0)
    with pytest.raises(ValueError, match="choose one"):
        Kriging().fit(x, y).predict(x, return_std=True, return_cov=True)


FORKED = """
import os
import numpy as np
from pitchline.kriging import Kriging

x = np.linspace(0.0, 1.0, 20)[:, None]
model = Kriging().fit(x, x[:, 0])
child = os.fork()
if child == 0:
    try:
        model.predict(x)
    except RuntimeError as error:
        os._exit(7 if "forkserver" in str(error) else 8)
    os._exit(9)
raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


def test_a_forked_process_is_refused_in_words():
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", FORKED], timeout=60, check=False)
    assert done.returncode == 7


LONG = """
import numpy as np
from pitchline import doe
from pitchline.kriging import Kriging

x = doe.random(4000, 10)
print("fitting", flush=True)
Kriging().fit(x, np.sin(9.0 * x).sum(axis=1), noise_variance=1e-4)
print("fitted", flush=True)
"""


def test_ctrl_c_ends_a_fit():
    child = subprocess.Popen([sys.executable, "-c", LONG], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "fitting\n"
    time.sleep(0.5)
    child.send_signal(signal.SIGINT)
    out, said = child.communicate(timeout=60.0)
    assert "KeyboardInterrupt" in said
    assert out == ""


def test_threads_of_python_run_while_rust_fits():
    x = doe.random(1500, 6)
    counted = 0
    done = threading.Event()

    def count():
        nonlocal counted
        while not done.wait(0.01):
            counted += 1

    counting = threading.Thread(target=count)
    counting.start()
    Kriging(starts=2).fit(x, np.sin(5.0 * x).sum(axis=1), noise_variance=1e-3)
    done.set()
    counting.join()
    assert counted > 3
