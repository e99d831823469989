"""Posterior of throw parameters, given counts of real dice, and its predictions.

The model of counts:

- A session is one way of throwing, a hand, which all dice of the session share. Its mean height h,
  speed v and spin w are in units of the die: h / a, v / sqrt(g a) and w sqrt(a / g), with the
  size a of the die. Throws of similar dice in equal units are similar, so sizes need not be known.
- Logarithms of these means are normal about a center that all sessions share, independently, with
  one standard deviation, `between`. Single throws differ from the means by up to `WITHIN`.
- Each material, a pair of what the die and the table are made of, has its own restitution and
  friction.
- The probabilities of a die scatter about the simulated ones by more than chance: dice are made
  imperfectly, and hands drift. They have a Dirichlet distribution with the concentration A, where
  `scatter` is 1 / (1 + A), so counts are Dirichlet-multinomial: the variance of n throws is
  1 + (n - 1) scatter times the multinomial's (Mosimann, Biometrika 49, 1962).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, gammaln, log_expit, logit, logsumexp, ndtri, xlogy
from scipy.stats import multivariate_t, qmc

from dicedesign.rest.outcomes import sums_by_outcome
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.rigid_body import RigidBody
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import GRAVITY, Table

SURFACES = {"restitution": (0.1, 0.9), "friction": (0.05, 1.2)}
"""Parameters of each material with the limits of their flat priors: from nearly dead to nearly
elastic, and from below Teflon to above rubber."""

HANDS = {
    "height": (2.0, 25.0),
    "speed": (0.3, 5.0),
    "spin": (0.25, 5.0),
    "between": (0.1, 0.8),
    "scatter": (1e-5, 0.02),
}
"""Parameters of all sessions, with the limits of their priors, which are flat in logarithms.

The center of the sessions' heights, speeds and spins is in units of the die. A die of 25 mm falls
from 5 cm, just out of the hand, to 63 cm, from above a table to its top or from a low throw to the
floor; it flies at 0.15 to 2.5 m/s, the speeds of a fall from 0.05 and 13 sizes; and it turns 0.8 to
16 times a second. It rolls out of a hand with twice its speed as spin. Less speed or spin is
negligible in a fall. Two of three sessions are within a factor of 1.1 to 2.2 of the center. A
scatter of 1e-5 is not seen in 10,000 throws; with 0.02, a probability of a half has a standard
deviation of 0.07. The limits are chosen, not measured."""

WITHIN = 0.5
"""Largest relative deviation of a throw's height, speed and spin from the session's means. Chosen,
not measured."""

SIZE = 0.025
"""Size of simulated dice and of the fitted table's, in m."""

UNITS = np.array([1.0, 1.0, SIZE, math.sqrt(GRAVITY * SIZE), math.sqrt(GRAVITY / SIZE)])
"""Units of restitution, friction, height, speed and spin for dice of `SIZE`, in SI units."""

FIRST = 0.5
"""Share of the evaluations that are spread over the prior; the others follow the posterior, in
`ROUNDS` rounds."""

ROUNDS = 4

SHARPNESS = 8
"""Power of the likelihood whose mean is the fitted set: near the most likely set for parameters
that the counts determine, and central for others."""

PILOT, FINAL = (2**11, 2**3), (2**12, 2**5)
"""Points for each proposal distribution of the posterior, and sessions at each point, before and
after the last simulation."""

DRAWS = 2**10
"""Number of sets that represent the posterior in predictions."""

TABLES = 32
"""Number of posterior tables of a fitted table."""

SERIES = 4000
"""Predicted series of throws for a p-value, whose standard error is then below 0.008."""

LENGTHS = (0.05, 50.0)
"""Range of the correlation lengths, in units of the parameters' ranges; the upper end means no
influence."""

VARIANCES = (1e-3, 20.0)
"""Range of the variance of logarithmic probabilities over the unit cube."""

EXCESSES = (1e-5, 0.3)
"""Range of the noise variance in excess of the counting noise."""

LEVEL = 4.0
"""Prior variance of the mean logarithmic probabilities about the mean of the observations."""

NODES = 9
"""Nodes of the Gauss-Hermite rule, exact for polynomials of degree 17."""

BLOCK = 2**13
"""Sets whose probabilities are computed at a time, to bound the memory."""

DEGREES, WIDER = 5.0, 1.3
"""Degrees of freedom of the proposal t distributions, whose tails are heavier than a posterior's,
and the factor of their covariance."""

MIN_EFFECTIVE = 60.0
"""Least effective sample size for a covariance; weights are raised to a power below 1 until it is
reached."""

MAX_ROUNDS = 8
"""Largest number of rounds of points for the posterior of all counts."""


@dataclass(frozen=True)
class CountedDie:
    """Real die with its counts.

    Attributes
    ----------
    body: the die as a rigid body. poses: its rests.
    outcome_of_rest: (k,) outcome of each rest; -1 for none.
    labels: of the g outcomes; indistinguishable outcomes are merged, as in "2 or 12".
    counts: (g,) of the outcomes.
    session, material: names; dice with equal ones share them.
    """

    name: str
    body: RigidBody
    poses: RestPoses
    outcome_of_rest: Integers
    labels: Sequence[str]
    counts: Integers
    session: str
    material: str

    def by_outcome(self, rests: NDArray[Any]) -> NDArray[Any]:
        """Sums (g,) of values (k,) over the rests of each outcome."""
        return sums_by_outcome(rests, self.outcome_of_rest, len(self.labels))


Throw = tuple[CountedDie, Table, int, tuple[int, ...]]
"""Die, table, number of drops, and numbers any change of which gives unrelated throws."""


def throw_die(throw: Throw) -> Integers:
    """Simulated counts (g,) of a die's outcomes on a table, as a die of the table's size."""
    die, table, drops, seed = throw
    (own,) = np.random.SeedSequence(seed).generate_state(1).tolist()
    return die.by_outcome(simulate(die.body, table, drops, own).counts)


class Limits:
    """Parameters within limits, by name; coordinates are values of surfaces, and logarithms of
    other values."""

    def __init__(self, limits: dict[str, tuple[float, float]]) -> None:
        self.names = list(limits)
        self.is_log = np.array([not name.startswith(tuple(SURFACES)) for name in limits])
        ends = np.array(list(limits.values())).T
        self.least, self.most = np.where(self.is_log, np.log(ends), ends)

    def coordinates(self, points: Floats) -> Floats:
        """Coordinates (..., d) at points (..., d) of the unit cube."""
        return self.least + (self.most - self.least) * points

    def values(self, points: Floats) -> Floats:
        """Values (..., d) at points (..., d) of the unit cube."""
        coordinates = self.coordinates(points)
        return np.where(self.is_log, np.exp(coordinates), coordinates)


SIMULATED = Limits({**SURFACES, "height": (2.0, 32.0), "speed": (0.1, 6.0), "spin": (0.1, 9.0)})
"""Limits of the means of a simulated session, within those of the momentum model; means outside are
clipped. At the least height, the lowest throws begin at the die's own size."""

LOWEST = math.log(3.2 / 2.0) / math.log(32.0 / 2.0)
"""Least coordinate of heights of posterior tables in the unit cube of `SIMULATED`, so that dice of
up to 40 mm fit below half of the mean height."""


class Prior(Limits):
    """Prior of the d parameters: `SURFACES` of each material, then `HANDS`."""

    def __init__(self, materials: list[str]) -> None:
        self.materials = materials
        surfaces = {
            f"{name} of {material}" if material else name: limits
            for material in materials
            for name, limits in SURFACES.items()
        }
        super().__init__(surfaces | HANDS)

    def concentration(self, points: Floats) -> Floats:
        """Concentrations A (...) of the Dirichlet distribution at points (..., d)."""
        return 1.0 / self.values(points)[..., -1] - 1.0

    def session_points(self, points: Floats, sessions: Floats, material: str) -> Floats:
        """Points (..., 5) in the unit cube of `SIMULATED` of the restitution and friction of a
        material, and the mean height, speed and spin of sessions (..., 3), at points (..., d)."""
        places, first = self.coordinates(points), 2 * self.materials.index(material)
        hands = places[..., -5:-2] + np.exp(places[..., -2:-1]) * sessions
        surfaces = np.broadcast_to(places[..., first : first + 2], (*hands.shape[:-1], 2))
        inside = np.concatenate([surfaces, hands], axis=-1) - SIMULATED.least
        return np.clip(inside / (SIMULATED.most - SIMULATED.least), 0.0, 1.0)


def spread_points(dimensions: int, count: int, rng: np.random.Generator) -> Floats:
    """(count, dimensions) points evenly spread in the unit cube, without its border."""
    even = qmc.Sobol(dimensions, rng=rng).random_base2((count - 1).bit_length())[:count]
    return np.clip(even, 1e-9, 1.0 - 1e-9)


def draw_sessions(count: int, rng: np.random.Generator) -> Floats:
    """(count, 3) equally likely sessions: standard normal deviations of the logarithms of height,
    speed and spin."""
    return ndtri(spread_points(3, count, rng))


def make_table(point: Floats) -> Table:
    """Table of a session at a point (5,) of the unit cube of `SIMULATED`, to three digits, as no
    counts determine more."""

    def digits(value: float) -> float:
        return float(f"{value:.3g}")

    restitution, friction, *means = map(digits, SIMULATED.values(point) * UNITS)
    hand = ((digits((1.0 - WITHIN) * mean), digits((1.0 + WITHIN) * mean)) for mean in means)
    return Table("fitted", restitution, friction, *hand, size=SIZE)


def fit_process(points: Floats, values: Floats, noise: Floats) -> tuple[Any, float]:
    """Gaussian process of noisy values (n,) at points (n, d) of the unit cube, minus their mean,
    and this mean. noise: (n,) variances of the values.

    Its covariance is squared exponential with a length for each parameter. Lengths, variance and
    excess noise maximize the marginal likelihood.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    smooth = ConstantKernel(0.3, VARIANCES) * RBF(np.ones(points.shape[1]), LENGTHS)
    kernel = smooth + ConstantKernel(LEVEL, "fixed") + WhiteKernel(1e-3, EXCESSES)
    mean = np.average(values, weights=1.0 / (noise + EXCESSES[1]))
    with warnings.catch_warnings():
        # Lengths may be at their upper end.
        warnings.simplefilter("ignore", ConvergenceWarning)
        return GaussianProcessRegressor(kernel, alpha=noise).fit(points, values - mean), mean


class Surrogate:
    """Surrogate of the probabilities of one die's g outcomes, by independent processes of the
    logarithm of each probability but the last over the sum of the later ones.

    Source: empirical logits, Cox, Analysis of Binary Data, 1970, chapter 3; such ratios of
    multinomial counts are independent.
    """

    def __init__(self, die: CountedDie, points: Floats, counts: Integers) -> None:
        """counts: (n, g) simulated at points (n, 5) of the unit cube."""
        self.die = die
        later = counts.sum(axis=1, keepdims=True) - counts.cumsum(axis=1)
        came, others = counts[:, :-1].T + 0.5, later[:, :-1].T + 0.5
        noise = 1.0 / came + 1.0 / others
        pairs = zip(np.log(came / others), noise, strict=True)
        self.processes = [fit_process(points, *pair) for pair in pairs]

    def predict(self, points: Floats) -> Floats:
        """Means and standard deviations (2, m, g - 1) of the ratios at points (m, 5), without
        noise."""
        ratios = []
        for process, mean in self.processes:
            means, deviations = process.predict(points, return_std=True)
            variances = deviations**2 - process.kernel_.k2.noise_level
            ratios.append((means + mean, np.sqrt(np.maximum(variances, 0.0))))
        return np.stack(ratios, axis=-1)

    def draw_probabilities(self, points: Floats, rng: np.random.Generator) -> Floats:
        """Random probabilities (m, g) of the posterior, independent at each point (m, 5)."""
        means, deviations = self.predict(points)
        parts = expit(means + deviations * rng.normal(size=means.shape))
        left = np.cumprod(1.0 - parts, axis=1)
        ones = np.ones((len(points), 1))
        return np.hstack([parts, ones]) * np.hstack([ones, left])

    def log_likelihood(self, points: Floats, concentration: Floats) -> Floats:
        """Log likelihood (m,) of the die's real counts at points (m, 5), without the number of
        their orders, averaged over the surrogate's uncertainty.
        The average of each outcome over later ones takes the expected probability that it is one of
        these. concentration: (m,) A of the Dirichlet distribution of the probabilities.

        Source: a Dirichlet-multinomial count given the earlier ones is beta-binomial; Johnson, Kotz
        and Balakrishnan, Discrete Multivariate Distributions, 1997, chapter 35, section 13.
        """
        nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
        counts = self.die.counts
        kinds = np.array([counts, counts.sum() - counts.cumsum()])[:, :-1, None]
        means, deviations = self.predict(points)
        later = np.cumprod(expit(-means), axis=1)
        whole = concentration[:, None, None] * np.insert(later, 0, 1.0, axis=1)[:, :-1, None]
        z = means[..., None] + deviations[..., None] * nodes
        each = -_log_rising(whole, kinds.sum(axis=0))
        for count, part in zip(kinds, (expit(z), expit(-z)), strict=True):
            each = each + _log_rising(whole * part, count)
        return logsumexp(each, axis=2, b=weights / weights.sum()).sum(axis=1)

    def by_session(self, prior: Prior, points: Floats, sessions: Floats) -> Floats:
        """Log likelihoods (n, k) of the die's counts in sessions (k, 3) at points (n, d)."""
        parts = []
        for block in np.array_split(points, -(-len(points) * len(sessions) // BLOCK)):
            at = block[:, None]
            sets = prior.session_points(at, sessions, self.die.material).reshape(-1, 5)
            concentration = np.repeat(prior.concentration(at), len(sessions))
            parts.append(self.log_likelihood(sets, concentration))
        return np.concatenate(parts).reshape(-1, len(sessions))


def _log_rising(start: Floats, count: Integers) -> Floats:
    """Logarithm of start (start + 1) ... (start + count - 1)."""
    return gammaln(start + count) - gammaln(start)


def log_likelihoods(
    prior: Prior, surrogates: Sequence[Surrogate], sessions: Floats, points: Floats
) -> Floats:
    """(n, 1 + c) logarithms of the likelihoods of the counts of all c dice, and of all but each, at
    points (n, d), averaged over equally likely sessions (k, 3)."""
    by_hand = np.stack([one.by_session(prior, points, sessions) for one in surrogates])
    names = np.array([one.die.session for one in surrogates])

    def total(is_in: NDArray[Any]) -> Floats:
        sums = [by_hand[is_in & (names == name)].sum(axis=0) for name in set(names)]
        return (logsumexp(sums, axis=2) - np.log(len(sessions))).sum(axis=0)

    every = np.ones(len(names), dtype=bool)
    return np.stack([total(every), *(total(~one) for one in np.diag(every))], axis=1)


@dataclass(frozen=True)
class WeightedPoints:
    """Weighted points of a posterior of several counts.

    Attributes
    ----------
    points: (n, d) of the unit cube, in which the prior is flat.
    log_priors: (n,) logarithms of prior over proposal density.
    log_likelihoods: (n, 1 + c) of all c counts, and of all but each of them.
    """

    points: Floats
    log_priors: Floats
    log_likelihoods: Floats

    def weights(self, column: int = 0, power: float = 1.0) -> Floats:
        """Weights (n,) with the sum 1 for a column of the likelihoods; power: exponent of each
        weight before normalization."""
        logarithms = power * (self.log_priors + self.log_likelihoods[:, column])
        return np.exp(logarithms - logsumexp(logarithms))

    def draw(self, count: int, rng: np.random.Generator, column: int = 0) -> Floats:
        """Equally likely points (count, d) in random order, by systematic resampling."""
        places = (np.arange(count) + rng.random()) / count
        numbers = np.searchsorted(self.weights(column).cumsum(), places)
        return self.points[rng.permutation(numbers.clip(max=len(self.points) - 1))]


def effective(weights: Floats) -> float:
    """Effective sample size of points with weights (n,)."""
    return float(1.0 / np.square(weights).sum())


def sample_posterior(
    log_likelihoods: Callable[[Floats], Floats],
    dimensions: int,
    each: int,
    left_out: int,
    rng: np.random.Generator,
) -> WeightedPoints:
    """Sample a posterior by adaptive importance sampling.

    Points are spread over the prior, then drawn from t distributions of logits with the mean and
    covariance of the posterior by the earlier points: once, or several times if the posterior is
    much narrower than the prior; finally also for the posteriors without each of the counts.
    Weights refer to the mixture of all proposal densities.

    log_likelihoods: function of points (n, d) with values as in `WeightedPoints`.
    each: points for each proposal distribution, a power of 2.
    left_out: number of counts of which each is to be left out.

    Source: Veach and Guibas, Optimally combining sampling techniques for Monte Carlo rendering,
    1995 (the balance heuristic).
    """
    points = spread_points(dimensions, each, rng)
    sample = WeightedPoints(points, np.zeros(len(points)), log_likelihoods(points))
    proposals = []
    is_last = False
    while not is_last:
        is_enough = effective(sample.weights()) >= MIN_EFFECTIVE
        is_last = bool(proposals) and (is_enough or len(proposals) == MAX_ROUNDS)
        new = [_propose(sample, column, rng) for column in range(1 + left_out * is_last)]
        proposals += new
        # Points at the border of the cube have no weight anyway.
        drawn = expit(np.concatenate([proposal.rvs(each) for proposal in new]))
        added = np.clip(drawn, 1e-12, 1.0 - 1e-12)
        points = np.concatenate([sample.points, added])
        places = logit(points)
        stretch = (log_expit(places) + log_expit(-places)).sum(axis=1)
        densities = [np.zeros(len(points)), *(one.logpdf(places) - stretch for one in proposals)]
        values = np.concatenate([sample.log_likelihoods, log_likelihoods(added)])
        log_priors = np.log(len(densities)) - logsumexp(densities, axis=0)
        sample = WeightedPoints(points, log_priors, values)
    return sample


def _propose(sample: WeightedPoints, column: int, rng: np.random.Generator) -> Any:
    """Proposal t distribution of logits of points."""
    power, places = 1.0, logit(sample.points)
    weights = sample.weights(column)
    # Powers of logarithms, as weights may underflow.
    while effective(weights) < MIN_EFFECTIVE:
        power /= 2.0
        weights = sample.weights(column, power)
    mean = weights @ places
    offsets = places - mean
    covariance = WIDER * offsets.T @ (weights[:, None] * offsets)
    return multivariate_t(mean, covariance, DEGREES, seed=rng)


class Posterior:
    """Posterior of throws of dice, and predictions.

    Attributes
    ----------
    prior: of the parameters.
    sample: weighted points of the parameters by the counts of the fitted dice.
    best: (d,) point of the fitted set; see `SHARPNESS`.
    surrogates: of the fitted dice, then of the others. fitted: those of the fitted dice.
    """

    def __init__(
        self,
        dice: Sequence[CountedDie],
        others: Sequence[CountedDie],
        evaluations: int,
        drops: int,
        seed: int,
        throw: Callable[..., Iterable[Integers]],
    ) -> None:
        """Sets of restitution, friction and a session's throws are simulated, first over all of
        them and then over the posterior of each material, and interpolated by surrogates. The
        likelihood of the real counts is averaged over the surrogates' uncertainty and over
        sessions. Each set has its own random numbers: common ones would not correlate the noise of
        neighboring sets, since bounces separate equal throws.

        evaluations: number of simulated sets; drops: of each die for each set.
        throw: simulates several throws, each as `throw_die`.
        """
        every, first = [*dice, *others], round(FIRST * evaluations)
        self.rng = rng = np.random.default_rng(seed)
        self.prior = prior = Prior(list(dict.fromkeys(die.material for die in every)))
        sets, counts = (
            [spread_points(5, first, rng)] * len(every),
            [[] for _ in every],
        )
        rounds = np.array_split(np.arange(first, evaluations), ROUNDS)
        for size in (*map(len, rounds), 0):
            self.surrogates = []
            for i, (die, points) in enumerate(zip(every, sets, strict=True)):
                counts[i] += throw(
                    [
                        (die, make_table(points[k]), drops, (seed, k, i))
                        for k in range(len(counts[i]), len(points))
                    ]
                )
                self.surrogates.append(Surrogate(die, points, np.array(counts[i])))
            self.fitted = self.surrogates[: len(dice)]
            count, sessions = PILOT if size else FINAL
            likelihoods = partial(log_likelihoods, prior, self.fitted, draw_sessions(sessions, rng))
            left_out = 0 if size else len(dice)
            self.sample = sample_posterior(likelihoods, len(prior.names), count, left_out, rng)
            if size:
                hands, drawn = draw_sessions(size, rng), self.sample.draw(size, rng)
                for i, die in enumerate(every):
                    new = prior.session_points(drawn, hands, die.material)
                    sets[i] = np.concatenate([sets[i], new])
        sharp = self.sample.log_priors + SHARPNESS * self.sample.log_likelihoods[:, 0]
        self.best = np.exp(sharp - logsumexp(sharp)) @ self.sample.points

    def best_table(self, material: str) -> Table:
        """Fitted table of a material, with the center of all sessions as throws."""
        return make_table(self.prior.session_points(self.best, np.zeros(3), material))

    def draw_tables(self) -> list[Table]:
        """Equally likely tables of the first material, each with throws of a new session; of the
        same session if there is only one."""
        points = self.sample.draw(TABLES, self.rng)
        is_only = len({one.die.session for one in self.fitted}) == 1
        sessions = self._draw_hands(points, self.fitted if is_only else [])
        sets = self.prior.session_points(points, sessions, self.prior.materials[0])
        sets[:, 2] = np.maximum(sets[:, 2], LOWEST)
        return list(map(make_table, sets))

    def _draw_hands(self, points: Floats, members: Sequence[Surrogate]) -> Floats:
        """Sessions (n, 3) at points (n, d), by the counts of some of their dice."""
        if not members:
            return draw_sessions(len(points), self.rng)
        hands = draw_sessions(FINAL[1], self.rng)
        by_hand = sum(one.by_session(self.prior, points, hands) for one in members)
        chances = np.exp(by_hand - logsumexp(by_hand, axis=1, keepdims=True))
        chosen = (chances.cumsum(axis=1) < self.rng.random((len(points), 1))).sum(axis=1)
        return hands[chosen.clip(max=len(hands) - 1)]

    def predict(self, number: int, *, without_own: bool) -> Floats:
        """Equally likely probabilities (m, g) of another such die in a die's session, by the counts
        of the fitted dice, perhaps without its own."""
        one, column = self.surrogates[number], 0
        members = [other for other in self.fitted if other.die.session == one.die.session]
        if without_own and one in members:
            members.remove(one)
            column = 1 + number
        points = self.sample.draw(DRAWS, self.rng, column)
        sessions = self._draw_hands(points, members)
        at = self.prior.session_points(points, sessions, one.die.material)
        means = one.draw_probabilities(at, self.rng)
        parts = self.rng.standard_gamma(self.prior.concentration(points)[:, None] * means)
        # A rare outcome may underflow to 0, whose logarithm is infinite.
        parts = np.maximum(parts, np.finfo(np.float64).tiny)
        return parts / parts.sum(axis=1, keepdims=True)

    def parameters(self) -> dict[str, Floats]:
        """Value in the fitted set, mean, standard deviation, ends of the 90 % credible interval,
        and standard deviation of the prior, of each parameter."""
        drawn = self.prior.values(self.sample.draw(2**14, self.rng))
        moments = drawn.mean(axis=0), drawn.std(axis=0), *np.quantile(drawn, [0.05, 0.95], axis=0)
        before = self.prior.values(self.rng.random(drawn.shape)).std(axis=0)
        rows = np.transpose([self.prior.values(self.best), *moments, before])
        return dict(zip(self.prior.names, rows, strict=True))


def p_value(counts: Integers, probabilities: Floats, rng: np.random.Generator) -> float:
    """Share of predicted series of throws with at most the likelihood ratio of the counts (g,):
    likelihood by the prediction, equally likely probabilities (m, g), over likelihood by the
    series' own frequencies.

    Source: Gelman, Meng and Stern, Statistica Sinica 6, 1996, with the likelihood ratio of the
    mixture of all probabilities as discrepancy.
    """
    throws = int(counts.sum())
    series = rng.multinomial(throws, probabilities[np.arange(SERIES) % len(probabilities)])
    both = np.concatenate([[counts], series])
    likelihoods = np.logaddexp.reduce(both @ np.log(probabilities).T, axis=1)
    fits = likelihoods - xlogy(both, both / throws).sum(axis=1)
    # The real series is included, so that no p-value is 0. Equal ratios may differ by rounding.
    return float((fits <= fits[0] + 1e-9 * abs(fits[0])).mean())
