"""Kriging (Gaussian-process regression) with known noise, by scikit-learn's conventions.

>>> import numpy as np
>>> from pitchline.kriging import Kriging
>>> x = np.linspace(0.0, 1.0, 12)[:, None]
>>> y = np.sin(6.0 * x[:, 0])
>>> model = Kriging().fit(x, y, noise_variance=1e-6)
>>> mean, sd = model.predict([[0.55]], return_std=True)
>>> bool(abs(mean[0] - np.sin(3.3)) < 4 * sd[0] + 1e-3)
True
"""

from __future__ import annotations

from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted, validate_data

from pitchline import _pitchline

__all__ = ["Interval", "Kriging", "LeaveOneOut"]

Array = NDArray[np.float64]


class Interval(NamedTuple):
    """The ends of intervals."""

    low: Array
    high: Array


class LeaveOneOut(NamedTuple):
    """Predictions of each observation from all others."""

    #: row numbers of X, from 0; only the first row of a repeated point
    observations: NDArray[np.uintp]
    #: observed less predicted
    residuals: Array
    #: residuals as multiples of their predicted standard deviations
    standardised: Array
    #: 1 less the share of the variance that is not predicted
    q2: float
    rmse: float
    #: share of the observations in their predicted 90 % intervals
    coverage_90: float


class Kriging(RegressorMixin, BaseEstimator):
    """A kriging model whose ranges maximise the likelihood.

    :param kernel: ``"matern-5-2"``, ``"matern-3-2"``, ``"squared-exponential"``, ``"exponential"``, products over the
        coordinates, or ``"radial-matern-5-2"``, ``"radial-matern-3-2"``, ``"radial-exponential"``
    :param trend: ``"constant"`` or ``"linear"``
    :param nugget: ``"known"``: no noise but the one given to :meth:`fit`; ``"estimated"``: one more variance;
        ``"auto"``: known if a noise is given, else estimated
    :param method: ``"exact"``, ``"vecchia"`` (the nearest observations), or ``"auto"``: exact up to 10 000
    :param response: ``"plain"``, or ``"log"`` for positive values that vary by factors
    :param estimator: of the ranges: ``"likelihood"``, or ``"posterior-mode"`` for few points
    :param calibrate: whether the predicted variances are scaled to the leave-one-out residuals
    :param starts: of the search for the ranges
    :param random_state: seed of the starts: a number, ``None`` for 0, or a ``numpy.random.RandomState``

    Attributes of a fitted model: ``mean_`` and ``slopes_`` of the trend; ``variance_`` of the process;
    ``ranges_``, the distances over which values resemble each other, in units of X; ``nugget_``, the estimated
    variance; ``log_likelihood_``; ``calibration_``, the factor of the variances; ``warnings_``, sentences about
    what is doubtful. The model of a campaign also has ``input_names_``, ``response_name_`` and ``noise_variance_``,
    that of a new observation.
    """

    def __init__(
        self,
        *,
        kernel: str = "matern-5-2",
        trend: str = "constant",
        nugget: str = "auto",
        method: str = "auto",
        response: str = "plain",
        estimator: str = "likelihood",
        calibrate: bool = False,
        starts: int = 20,
        random_state: int | np.random.RandomState | None = None,
    ) -> None:
        self.kernel = kernel
        self.trend = trend
        self.nugget = nugget
        self.method = method
        self.response = response
        self.estimator = estimator
        self.calibrate = calibrate
        self.starts = starts
        self.random_state = random_state

    def fit(self, X: ArrayLike, y: ArrayLike, noise_variance: ArrayLike | None = None) -> Kriging:
        """Fits to observations.

        :param X: shape (n, d)
        :param y: n numbers
        :param noise_variance: of each observation, n numbers or one, in units of y²
        """
        data = validate_data(self, X, y, y_numeric=True, dtype=np.float64, order="C", ensure_min_samples=2)
        x, values = cast(tuple[Array, Array], data)
        nugget = self.nugget
        if nugget == "auto":
            nugget = "estimated" if noise_variance is None else "known"
        noise = np.asarray(0.0 if noise_variance is None else noise_variance, dtype=float)
        if noise.ndim == 0:
            noise = np.full(len(values), noise)
        state = self.random_state
        if state is None:
            seed = 0
        elif isinstance(state, (int, np.integer)):
            seed = int(state)
        else:
            seed = int(check_random_state(state).randint(2**31))
        self._set(
            _pitchline.Model.fit(
                x,
                np.asarray(values, dtype=float),
                noise,
                self.kernel,
                self.trend,
                nugget,
                self.method,
                self.response,
                self.estimator,
                self.calibrate,
                self.starts,
                seed,
            )
        )
        return self

    def _set(self, model: _pitchline.Model) -> None:
        self._model = model
        self.mean_, self.variance_, self.ranges_, self.slopes_, self.nugget_ = model.parameters()
        self.log_likelihood_ = model.log_likelihood()
        self.calibration_ = model.calibration()
        self.warnings_ = model.warnings()

    @classmethod
    def _stored(
        cls, model: _pitchline.Model, names: list[str], response: str, noise_variance: float
    ) -> Kriging:
        """The model of a campaign."""
        fitted = cls(kernel=model.kernel(), response="log" if model.is_log() else "plain")
        fitted._set(model)
        fitted.n_features_in_ = len(names)
        fitted.input_names_ = names
        fitted.response_name_ = response
        fitted.noise_variance_ = noise_variance
        return fitted

    def _points(self, X: ArrayLike) -> Array:
        check_is_fitted(self, "_model")
        # The checks of scikit-learn take longer than a prediction.
        if (
            type(X) is np.ndarray
            and X.dtype == np.float64
            and X.ndim == 2
            and X.shape[0] > 0
            and X.shape[1] == self.n_features_in_
            and not hasattr(self, "feature_names_in_")
            and np.isfinite(X).all()
        ):
            return X
        return cast(Array, validate_data(self, X, dtype=np.float64, order="C", reset=False))

    def predict(
        self, X: ArrayLike, return_std: bool = False, return_cov: bool = False
    ) -> Array | tuple[Array, Array]:
        """Means of the function at points, shape (n, d).

        :param return_std: whether to return the standard deviations as well, n numbers
        :param return_cov: whether to return the covariances as well, shape (n, n); of a model of ln y those of ln y to
            first order in y
        :returns: n means, or means and deviations, or means and covariances
        """
        x = self._points(X)
        if return_std and return_cov:
            raise ValueError("return_std and return_cov are both true: choose one")
        if return_cov:
            mean, covariance = self._joint(x)
            if self._model.is_log():
                mean = np.exp(mean)
                covariance = covariance * np.outer(mean, mean)
            return mean, covariance
        if return_std:
            mean, variance = self._model.predict(x)
            return mean, np.sqrt(variance)
        return self._model.means(x)

    def _joint(self, x: Array) -> tuple[Array, Array]:
        """Means and covariances of the modelled quantity: y, or ln y."""
        joint = self._model.joint(x)
        if joint is None:
            raise ValueError(
                "the approximate method has no joint distribution of several points: "
                'fit with method="exact", or ask for return_std'
            )
        return joint

    def gradient(self, X: ArrayLike) -> Array:
        """Gradients of the mean, shape (n, d), in units of y per unit of X."""
        gradients = self._model.gradients(self._points(X))
        if gradients is None:
            raise ValueError('the mean of the approximate method is not continuous: fit with method="exact"')
        return gradients

    def quantile(self, X: ArrayLike, level: float, *, noise_variance: float | None = None) -> Array:
        """Quantiles of the function at points or, with ``noise_variance``, of an observation with that noise."""
        mean, variance = self._model.predict(self._points(X))
        return self._model.quantiles(mean, variance, noise_variance or 0.0, level)

    def interval(self, X: ArrayLike, probability: float = 0.9, *, noise_variance: float | None = None) -> Interval:
        """Intervals of the function at points or, with ``noise_variance``, of an observation with that noise."""
        mean, variance = self._model.predict(self._points(X))
        ends = [(1.0 - probability) / 2.0, (1.0 + probability) / 2.0]
        low, high = (self._model.quantiles(mean, variance, noise_variance or 0.0, end) for end in ends)
        return Interval(low, high)

    def sample_y(
        self, X: ArrayLike, n_samples: int = 1, random_state: int | np.random.RandomState | None = 0
    ) -> Array:
        """Functions drawn from the posterior, shape (n, n_samples)."""
        mean, covariance = self._joint(self._points(X))
        # Rounding leaves eigenvalues just below zero, which count as zero.
        values, vectors = np.linalg.eigh(covariance)
        normal = check_random_state(random_state).standard_normal((len(mean), n_samples))
        drawn: Array = mean[:, None] + (vectors * np.sqrt(np.maximum(values, 0.0))) @ normal
        return np.exp(drawn) if self._model.is_log() else drawn

    def leave_one_out(self) -> LeaveOneOut:
        """Predicts each observation from all others, with the ranges of the fit."""
        check_is_fitted(self, "_model")
        return LeaveOneOut(*self._model.leave_one_out())

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "_model")

    def __getstate__(self) -> dict[str, Any]:
        state = cast(dict[str, Any], super().__getstate__()).copy()
        if "_model" in state:
            state["_model"] = state["_model"].to_json()
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        state = dict(state)
        if "_model" in state:
            state["_model"] = _pitchline.Model.from_json(state["_model"])
        super().__setstate__(state)
