# SPDX-License-Identifier: BSD-3-Clause
"""The expression language on whole layers."""

import ast
import math
import operator
import pickle
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, strategies as st

from grid_map_core_py.testing import grid_maps
from grid_map_filters_py.errors import ExpressionError, FilterError
from grid_map_filters_py.expression import Expression

pytestmark = pytest.mark.filterwarnings("error")


def fortran(values) -> np.ndarray:
    return np.asfortranarray(np.array(values, dtype=np.float32))


def layers() -> dict[str, np.ndarray]:
    return {
        "elevation": fortran([[1, 2, 3, 4], [5, 6, 7, 8], [9, 10, 11, 12]]),
        "variance": fortran([[0.5, 0, np.nan, 1], [2, np.inf, -1, 0.25], [-np.inf, 3, 1, 1]]),
        "row": fortran([[10, 11, 12, 13, 14]]),
        "square_": fortran([[1, 2], [3, 4]]),
    }


def value(text, **more):
    return Expression(text)({**layers(), **more})


@given(grid_maps(("a", "b")))
def test_result_for_a_moved_map_has_its_order(grid_map):
    in_map_order = {name: grid_map.unwrapped(name) for name in grid_map}
    for text in ("a .* 2 + b", "a - meanOfFinites(b)"):
        grid_map["out"] = Expression(text)(grid_map)
        np.testing.assert_array_equal(grid_map.unwrapped("out"), Expression(text)(in_map_order))
    assert Expression("maxOfFinites(a)")(grid_map.with_layers({"a": 2.0})) == 2.0


# --- numbers and operators ------------------------------------------------------------------------


@given(st.floats(allow_nan=False))
def test_printed_numbers_are_read_back(number):
    assert Expression(repr(number))({}) == number


BINARY = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
UNARY = {ast.USub: operator.neg, ast.UAdd: operator.pos}


def as_python(node: ast.expr) -> float:
    """Evaluate with Python's grammar, where these operators have the same precedence."""
    if isinstance(node, ast.BinOp):
        return BINARY[type(node.op)](as_python(node.left), as_python(node.right))
    if isinstance(node, ast.UnaryOp):
        return UNARY[type(node.op)](as_python(node.operand))
    assert isinstance(node, ast.Constant)
    return np.float64(node.value)


arithmetic = st.recursive(
    st.integers(0, 9).map(str),
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from([" + ", " - ", " * ", " / "]), inner).map("".join),
        inner.map(lambda text: f"({text})"),
        inner.map(lambda text: f"-{text}"),
        inner.map(lambda text: f"+{text}"),
    ),
    max_leaves=12,
)


@given(arithmetic)
def test_arithmetic_follows_the_usual_precedence(text):
    with np.errstate(all="ignore"):
        expected = as_python(ast.parse(text, mode="eval").body)
    np.testing.assert_allclose(Expression(text)({}), expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("text", "number"),
    [
        *[("5.", 5), (".5", 0.5), ("1e3", 1000), ("1E-3", 0.001), ("1.5e+2", 150)],
        ("1e400", np.inf),
        ("2^-1", 0.5),
        ("2^-2^2", 0.0625),
        ("1 + 2 < 4", 1),
        ("(1 < 2) .* (2 >= 3)", 0),
        ("2 .^ 3 ./ 4", 2),
        ("2 != nan", 1),
        ("\n1 +\n\t2\n", 3),
    ],
)
def test_numbers_and_operators_between_them(text, number):
    np.testing.assert_equal(Expression(text)({}), number)


def test_one_by_one_layer_fits_every_shape():
    cell = fortran([[4]])
    assert value("sqrt(cell)", cell=cell).shape == (1, 1)
    assert value("min(cell, other)", cell=cell, other=fortran([[3]])) == 3
    assert value("cell * elevation", cell=cell).shape == (3, 4)


# --- matrices, ranges and indices -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "matrix"),
    [
        ("[1, -2; +3, 2*2]", [[1, -2], [3, 4]]),
        ("[[1, 2]; [3, 4]]", [[1, 2], [3, 4]]),
        ("[square_, [5; 6]; 7:9]", [[1, 2, 5], [3, 4, 6], [7, 8, 9]]),
        ("6:-2:1", [[6, 4, 2]]),
        ("0:0.1:0.3", [[0, 0.1, 0.2, 0.3]]),
        ("1:1+1", [[1, 2]]),
        ("3:3", 3),
        ("[7]", 7),
        ("ones(2)", [[1, 1], [1, 1]]),
    ],
)
def test_matrices_and_ranges(text, matrix):
    np.testing.assert_array_equal(value(text), np.float32(matrix))


@pytest.mark.parametrize(
    ("text", "picked"),
    [
        ("elevation(end, end)", 12),
        ("elevation(end, 0) + elevation(0, end) + row(end)", 9 + 4 + 14),
        ("elevation(1:2, 2:end)", [[7, 8], [11, 12]]),
        ("elevation(:, end:-1:0)(0, :)", [[4, 3, 2, 1]]),
        ("elevation([0, 2], [3, 0])", [[4, 1], [12, 9]]),
        ("row(end - 1:end)", [[13, 14]]),
        ("row(:)", [[10, 11, 12, 13, 14]]),
        ("transpose(row)(4)", 14),
        ("row(cwiseMin(end, 3))", 13),
        ("row(row(end - 4) - 8)", 12),
        ("elevation(0, 0)(0)", 1),
    ],
)
def test_indices_start_at_zero(text, picked):
    np.testing.assert_array_equal(value(text), picked)


# --- functions ------------------------------------------------------------------------------------


FINITE_REDUCTIONS = ["min", "max", "mean", "sum"]
ANGLES = ["sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"]
NUMBERS = ["abs", "sqrt", "exp", "log", "log10", "floor", "ceil"]


@pytest.mark.parametrize("name", ANGLES + NUMBERS)
def test_elementwise_functions_equal_the_math_module(name):
    numbers = [[-2.5, -0.75, -0.0, 0.3, 1.0, 2.5]]

    def reference(number):
        try:
            return float(getattr(math, name if name != "abs" else "fabs")(number))
        except ValueError:
            return -np.inf if name.startswith("log") and number == 0 else np.nan

    np.testing.assert_allclose(
        value(f"{name}(m)", m=fortran(numbers)), [list(map(reference, numbers[0]))], rtol=1e-6
    )


def test_round_rounds_halves_away_from_zero():
    halves = fortran([[-2.5, -0.5, 0.5, 1.5, 0.49999997, 8388609, np.inf, np.nan]])
    np.testing.assert_array_equal(
        value("round(m)", m=halves), [[-3, -1, 1, 2, 0, 8388609, np.inf, np.nan]]
    )


def test_plain_reductions_keep_nan_and_finite_reductions_skip_it():
    for name in ["min", "max", "absmax", "mean", "sum", "prod", "norm"]:
        assert math.isnan(value(f"{name}(variance)"))
    finite = layers()["variance"][np.isfinite(layers()["variance"])]
    assert value("numberOfFinites(variance)") == 9
    assert value("minOfFinites(variance)") == finite.min()
    assert value("maxOfFinites(variance)") == finite.max()
    assert value("sumOfFinites(variance)") == finite.sum()
    assert value("meanOfFinites(variance)") == pytest.approx(finite.mean())


@pytest.mark.parametrize(
    ("text", "result"),
    [
        ("sum(elevation, 1)", [[10], [26], [42]]),
        ("mean(elevation, 1)", [[2.5], [6.5], [10.5]]),
        ("min(elevation, 1)", [[1], [5], [9]]),
        ("absmax([-9, 3; 1, 2], 1)", [[-9], [2]]),
        ("absmax([-9, 3])", -9),
        ("size(elevation)", [[3, 4]]),
        ("size(elevation, 0)", 3),
        ("trace(square_)", 5),
        ("trace(elevation)", 18),
        ("conjugate([1, 2])", [[1, 2]]),
        ("cwiseMax(square_, [4, 3; 2, 1])", [[4, 3], [3, 4]]),
        ("min(square_, [4, 3; 2, 1])", [[1, 2], [2, 1]]),
        ("where(square_ > 2, square_, -1)", [[-1, -1], [3, 4]]),
        ("isfinite([1, nan, inf])", [[1, 0, 0]]),
        ("atan2(1, -1)", 0.75 * np.pi),
        ("2 * pi", 2 * np.pi),
        ("max([1, inf])", np.inf),
        ("sum([1, inf])", np.inf),
        ("min([1, inf])", 1),
        *((f"{name}OfFinites([nan, inf; -inf, nan])", np.nan) for name in FINITE_REDUCTIONS),
        ("numberOfFinites([nan, inf; -inf, nan])", 0),
        ("square_ .* square_", [[1, 4], [9, 16]]),
        ("square_ ^ square_", [[1, 4], [27, 256]]),
        *((text, [[2, 4], [6, 8]]) for text in ("2*square_", "square_.*2", "square_*[2]")),
        ("5.*square_", [[5, 10], [15, 20]]),
        ("square_(0,1)*square_", [[2, 4], [6, 8]]),
        ("square_^2", [[1, 4], [9, 16]]),
        ("(square_ + 1) .* (square_ + 1) - (square_ + 1)", [[2, 6], [12, 20]]),
    ],
)
def test_operators_and_functions_of_matrices(text, result):
    np.testing.assert_array_equal(value(text), result)


def test_layer_hides_function_and_constant_of_its_name():
    mean, pi = fortran([[1, 2], [3, 4]]), fortran([[3]])
    assert value("mean(1, 0)", mean=mean) == 3
    assert value("mean([1, 0])") == 0.5
    np.testing.assert_array_equal(value("pi + 1", pi=pi), [[4]])
    # Names need not be identifiers.
    odd = {"costs.slope": fortran([[1]]), "my-layer": fortran([[2]]), "höhe": fortran([[3]])}
    np.testing.assert_array_equal(value('costs.slope + "my-layer" + höhe', **odd), [[6]])
    with pytest.raises(ExpressionError, match="the layer 'mean' hides the function"):
        value("mean(elevation)", mean=mean)


def test_sums_accumulate_in_double_precision():
    layer = np.full((1000, 1000), 1000.1, np.float32, order="F")
    assert value("mean(m)", m=layer) == pytest.approx(float(np.float32(1000.1)), rel=1e-12)


# --- the values -----------------------------------------------------------------------------------

ELEMENTWISE = [
    "elevation",
    "-elevation",
    "elevation + 1",
    "2 * elevation ^ 2 ./ (1 + variance)",
    "elevation * 1e300",
    "where(elevation > 3, elevation, 0.5)",
    "elevation > variance",
    "round(elevation) + zeros(3, 4)",
    "elevation(:, 1:3) - elevation(:, 0:2)",
    "acos(variance) + (elevation - mean(elevation))",
    "[elevation, variance]",
    "conjugate(elevation)",
]


@pytest.mark.parametrize("text", [*ELEMENTWISE, "transpose(elevation)", "+elevation", "row(:)"])
def test_layers_keep_type_and_order_and_are_never_shared(text):
    given_layers, before = layers(), layers()
    expression = Expression(text)
    result, again = expression(given_layers), expression(given_layers)
    assert result.dtype == np.float32
    assert result.flags.f_contiguous or text not in ELEMENTWISE
    assert not np.shares_memory(result, again)
    assert not any(np.shares_memory(result, layer) for layer in given_layers.values())
    result[:] = 0
    for name, layer in given_layers.items():
        np.testing.assert_array_equal(layer, before[name])
        assert layer.flags.writeable


def test_reductions_give_floats_and_other_types_become_float32():
    assert type(value("mean(elevation)")) is float
    assert type(value("elevation(0, 0)")) is float
    assert value("elevation - mean(elevation)").dtype == np.float32
    for layer in [np.arange(6).reshape(2, 3), np.ones((2, 3)), np.ones((2, 3), bool)]:
        assert value("m ./ 2", m=layer).dtype == np.float32


# --- expressions as objects -----------------------------------------------------------------------


def test_expression_keeps_text_and_names_also_when_pickled():
    text = "a + mean(b) .* c(0, end) + pi - nope(3)"
    expression = pickle.loads(pickle.dumps(Expression(text)))
    assert (expression.text, expression.names) == (text, {"a", "b", "c", "nope"})
    assert expression == Expression(text) != Expression("a")


# --- errors ---------------------------------------------------------------------------------------

AT_CONSTRUCTION = [
    # expression, column of the caret, message
    ("", 0, "the expression is empty"),
    ("(a", 2, "ends too early, expected ')'"),
    ("[1, 2", 5, "expected ']' or ',' or ';'"),
    ("a + ", 3, "ends too early, expected a value"),
    ("1 2", 2, "unexpected '2', expected an operator"),
    ("1.2.3", 3, "unexpected '.3'"),
    ("2(3)", 1, "unexpected '('"),
    ("a)", 1, "unexpected ')'"),
    ("a(1;2)", 3, "unexpected ';', expected ')' or ','"),
    ("[1 2]", 3, "unexpected '2', expected an operator or ']' or ',' or ';'"),
    ("a = b", 2, "assignment is not part of the language"),
    ("a'", 1, "use transpose(m)"),
    ("a ** 2", 3, "use '^'"),
    ("a && b", 2, "'.*' for and"),
    ("!a", 0, "'m == 0' for not"),
    ('"a', 0, "no closing"),
    ("a # b", 2, "unexpected '#'"),
    ("0 < a < 1", 6, "comparisons cannot be chained"),
    ("1:2:3:4", 5, "first:step:last"),
    ("end + 1", 0, "only in an index"),
    ("abs(a, b)", 0, "abs takes 1 argument, not 2"),
    ("1 + where(a, b)", 4, "where takes 3 arguments, not 2"),
    ("eye(2, 3, 4)", 0, "eye takes 1 or 2 arguments, not 3"),
    ("wher(a, 1, 2)", 0, "no function 'wher'; did you mean where?"),
    ("a(0, 1, 2)", 0, "an index has one or two places"),
    ("zeros(1.5)", 6, "must be whole and positive"),
    ("eye(-1, 2)", 4, "must be whole and positive"),
    ("ones(1e5, 1e5 + 0)", 0, "100000 x 100000 is too large"),
    ("[1, 2] + [1, 2, 3]", 7, "the shapes 1 x 2 and 1 x 3 do not match"),
    ("[1, 2; 3]", 7, "this row has 1 columns, the first row 2"),
    ("[1, [2; 3]]", 4, "this part has 2 rows, the first part of its row 1"),
    ("5:1", 0, "empty or endless"),
    ("1:0:3", 0, "empty or endless"),
    ("a(-1, 0)", 2, "index -1 is out of range"),
    ("a(0, 0.5)", 5, "must be a whole number, not 0.5"),
    ("[1, 2](2)", 7, "index 2 is out of range; indices go from 0 to 1"),
    ("sum(a, 2)", 7, "the axis must be 0 (per column) or 1 (per row)"),
    ("min(a, 0.5)", 7, "use cwiseMin(m, s)"),
    ("-" * 200 + "1", 151, "nested too deeply"),
]

AT_EVALUATION = [
    ("elevtion + 1", 0, "no layer 'elevtion'; available: elevation, row, square_, variance; did"),
    ("1 + sqroot(elevation)", 4, "row, square_, variance; did you mean sqrt?"),
    ("elevation + row", 10, "the shapes 3 x 4 and 1 x 5 do not match"),
    ("elevation * elevation", 10, "no matrix product of 3 x 4 and 3 x 4; use '.*'"),
    ("elevation / elevation", 10, "use './'"),
    ("1 + elevation(3, 0)", 14, "index 3 is out of range; indices go from 0 to 2"),
    ("elevation(0, end + 1)", 17, "index 4 is out of range; indices go from 0 to 3"),
    ("elevation(5)", 0, "one index needs a vector, this is 3 x 4; write m(row, column)"),
    ("row(elevation)", 4, "an index is a number or a vector, not 3 x 4"),
    ("sum(elevation, variance)", 15, "the axis must be 0"),
    ("cwiseMin(1, elevation)", 9, "the matrix comes first"),
    ("[elevation; row]", 12, "this row has 5 columns, the first row 4"),
    ("0:elevation", 2, "a range needs numbers, this is 3 x 4"),
    ("sum(:)", 4, "is valid only in an index"),
    ("row(1.5 + elevation(0, 0) - 1)", 26, "must be a whole number"),
]


def assert_points_at(error: ExpressionError, text: str, column: int, message: str):
    assert isinstance(error, FilterError)
    assert isinstance(error, ValueError)
    first, line, caret = str(error).split("\n")
    assert message in first
    indent = len(line) - len(line.lstrip()) if text.strip() else 4
    assert line[indent:] == text
    assert caret == " " * (indent + column) + "^"


@pytest.mark.parametrize(("text", "column", "message"), AT_CONSTRUCTION + AT_EVALUATION)
def test_errors_point_at_their_place(text, column, message):
    raises = Expression if (text, column, message) in AT_CONSTRUCTION else value
    with pytest.raises(ExpressionError) as caught:
        raises(text)
    assert_points_at(caught.value, text, column, message)


def test_expression_of_several_lines_is_shown_in_one():
    with pytest.raises(ExpressionError) as caught:
        Expression("a\n+\t(b")
    assert str(caught.value).split("\n")[1:] == ["    a + (b", "          ^"]


def test_other_types_than_text_and_matrices_are_refused():
    with pytest.raises(ExpressionError, match="must be a text, not 5"):
        Expression(5)
    with pytest.raises(ExpressionError) as caught:
        value("1 + m", m=np.ones(3, np.float32))
    message = "the layer 'm' must have rows and columns, its shape is (3,)"
    assert_points_at(caught.value, "1 + m", 4, message)


@given(st.text(alphabet="ab1.+-*/^()[],:;<>=! \"'end", max_size=20))
def test_any_text_gives_expression_or_expression_error(text):
    with suppress(ExpressionError):
        Expression(text)({"a": fortran([[1, 2], [3, 4]])})
