"""The information form equals the Kalman filter as the textbooks write it, and the estimate finds the field."""

from __future__ import annotations

import numpy as np
import pytest
from maps_fixtures import box_field, flight, seeing

from mpc_cover.information.kalman import KalmanMap
from mpc_cover.information.scalar_field import NoisySensing, bumpy_field

NOISE = np.array([0.5, 1.0, 2.0])


def gain_form(variance, estimate, noise, reading):
    """One step of the thesis's filter for one cell and the sensors that see it."""
    h = np.ones((noise.size, 1))
    gain = variance * h.T @ np.linalg.inv(variance * h @ h.T + np.diag(noise))
    after = estimate + gain @ (reading - estimate)
    return (1.0 - (gain @ h).item()) * variance, float(after.item())


def test_equals_the_gain_form_with_many_sensors_a_step():
    rng = np.random.default_rng(0)
    field = box_field(3.0, 2.0)
    sight = seeing(field, 3, 1.5)
    truth = rng.normal(size=(1, field.size))
    sensing = NoisySensing(sight, truth, NOISE, rng)
    information = KalmanMap(sensing, variance=4.0, noise=NOISE, enough=0.1, mean=0.3)
    variance, estimate = np.full(field.size, 4.0), np.full(field.size, 0.3)
    for n, position in enumerate(flight(rng, field, 10)):
        looks = sensing.looks(float(n), position)
        information.take(looks)
        for k in range(field.size):
            here = looks.place == k
            if here.any():
                z, r = looks.value[here], NOISE[looks.agent[here]]
                variance[k], estimate[k] = gain_form(variance[k], estimate[k], r, z)
    np.testing.assert_allclose(information.variance[0], variance, rtol=1e-12)
    np.testing.assert_allclose(information.estimate[0], estimate, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(information.residual[0], np.maximum(variance - 0.1, 0.0), atol=1e-12)


def test_without_readings_the_variance_falls_and_the_estimate_stays():
    field = box_field(1.0, 1.0)
    information = KalmanMap(seeing(field, 1, 5.0), variance=1.0, noise=1.0, enough=0.2, mean=2.5)
    for n in range(4):
        information.observe(float(n), np.array([[0.5, 0.5]]))
    np.testing.assert_allclose(information.variance, 0.2)
    np.testing.assert_allclose(information.estimate, 2.5)
    assert information.complete


def test_fifteen_looks_with_unit_noise_reach_a_sixteenth():
    field = box_field(1.0, 1.0)
    information = KalmanMap(seeing(field, 1, 5.0), variance=1.0, noise=1.0, enough=0.0625)
    assert (information.looks_owed == 15).all()
    for n in range(15):
        assert not information.complete
        information.observe(float(n), np.array([[0.5, 0.5]]))
    assert information.complete
    assert (information.looks_owed == 0).all()


def test_a_prior_that_is_good_enough_owes_nothing():
    assert KalmanMap(seeing(box_field()), variance=0.5, noise=1.0, enough=0.5).complete


def test_the_error_is_what_the_variance_says():
    """A thousand cells at once: the normalised errors have unit variance (5 sigma of its estimate)."""
    rng = np.random.default_rng(1)
    field = box_field(10.0, 10.0, 0.3)
    truth = rng.normal(0.0, 2.0, (1, field.size))
    sensing = NoisySensing(seeing(field, 3, 20.0), truth, NOISE, rng)
    information = KalmanMap(sensing, variance=4.0, noise=NOISE, enough=0.01)
    for n in range(5):
        information.observe(float(n), np.zeros((3, 2)))
    normalised = (information.estimate - truth) / np.sqrt(information.variance)
    assert abs(normalised.mean()) < 5.0 / np.sqrt(field.size)
    assert abs(normalised.var() - 1.0) < 5.0 * np.sqrt(2.0 / field.size)


def test_the_field_and_its_readings_repeat_with_the_seed():
    cell = box_field().cell
    first, second = (bumpy_field(cell, np.random.default_rng(7)) for _ in range(2))
    assert (first == second).all()
    assert first.min() < 0.0 < first.max()
    sensing = [NoisySensing(seeing(box_field()), first[None], 0.5, np.random.default_rng(1)) for _ in range(2)]
    looks = [each.looks(0.0, np.ones((3, 2))) for each in sensing]
    assert (looks[0].value == looks[1].value).all()
    assert sensing[0].shape == (1, cell.shape[0])
    # one agent of the fleet alone, whose R is not the first
    alone = NoisySensing(seeing(box_field()), first[None], NOISE, np.random.default_rng(1))
    assert alone.looks(0.0, np.ones((1, 2)), np.array([2])).value.std() > 0.0


def test_one_noise_for_all_is_the_same_as_one_each():
    field = box_field()
    path = flight(np.random.default_rng(2), field)
    one = KalmanMap(seeing(field), variance=1.0, noise=0.7, enough=0.1)
    each = KalmanMap(seeing(field), variance=1.0, noise=np.full(3, 0.7), enough=0.1)
    for n, position in enumerate(path):
        one.observe(float(n), position)
        each.observe(float(n), position)
    assert one.variance == pytest.approx(each.variance)
