# Copyright 2026 cpg_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The vectorisable tanh against libm's."""

import math

from depth import examples
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from vector_functions import over, tanh

SPECIAL = [0.0, -0.0, math.inf, -math.inf, 5e-324, -5e-324, 2.2250738585072014e-308,
           -2.2250738585072009e-308, 1e-160, 1e-8, 0.5 * math.log(2.0), 19.06, 19.07, 20.0,
           math.nextafter(20.0, 21.0), 709.8, 710.5, 1e16, 1.7976931348623157e308]


def ulps(x, got):
    want = math.tanh(x)
    return abs(got - want) / math.ulp(want)


@examples(1000)
@given(st.floats(allow_nan=False))
def test_within_four_ulp_of_libm(x):
    assert ulps(x, tanh(x)) <= 4.0


@examples(1000)
@given(st.floats(-25.0, 25.0))
def test_within_four_ulp_where_it_bends(x):
    # Most finite floats are tiny or huge; the polynomial is only at work in here.
    assert ulps(x, tanh(x)) <= 4.0


@examples(1000)
@given(st.floats(-25.0, 25.0))
def test_odd_symmetry_is_exact(x):
    # The symmetry classes of the network stay exact in floating point because of this.
    assert tanh(-x) == -tanh(x)


@pytest.mark.parametrize('x', SPECIAL)
def test_special_values(x):
    assert ulps(x, tanh(x)) <= 4.0
    assert math.copysign(1.0, tanh(x)) == math.copysign(1.0, x)


def test_nan_stays_nan():
    # The watchdog relies on it: a NaN must not turn into a number in the network.
    for nan in (math.nan, -math.nan):
        assert math.isnan(tanh(nan))


def test_vectorised_loop_within_four_ulp_and_bounded():
    # Vector registers may contract differently from the scalar code, and NaN sits beside numbers.
    rng = np.random.default_rng(1)
    signs = rng.choice([-1.0, 1.0], 100_000)
    values = np.concatenate([rng.uniform(-22.0, 22.0, 100_000), SPECIAL, [math.nan] * 7,
                             signs * 10 ** rng.uniform(-308, 308, 100_000)])
    out = over('tanh', values)
    want = np.array([math.tanh(x) for x in values])
    assert np.array_equal(np.isnan(out), np.isnan(values))
    known = ~np.isnan(values)
    error = np.abs(out - want)[known] / np.spacing(np.abs(want[known]))
    assert error.max() <= 4.0
    assert np.abs(out[known]).max() <= 1.0


def test_vectorised_loop_is_odd():
    values = np.random.default_rng(2).normal(0.0, 3.0, 10_001)
    assert np.array_equal(over('tanh', values), -over('tanh', -values))
