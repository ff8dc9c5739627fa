"""C statements of the scalar operations of an SX function."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

CODES = {getattr(ca, name): name[3:] for name in dir(ca) if name.startswith("OP_")}
UNARY: Mapping[str, str] = {
    **{"ASSIGN": "{0}", "NEG": "-{0}", "SQ": "{0}*{0}", "TWICE": "2.*{0}", "INV": "1./{0}", "NOT": "{0}==0."},
    **{"SIGN": "sign({0})", "FABS": "fabs({0})"},
    **{
        name: name.lower() + "({0})"
        for name in (
            *("EXP", "LOG", "SQRT", "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "SINH", "COSH", "TANH", "ASINH"),
            *("ACOSH", "ATANH", "FLOOR", "CEIL", "ERF", "LOG1P", "EXPM1"),
        )
    },
}
BINARY: Mapping[str, str] = {
    **{"ADD": "{0}+{1}", "SUB": "{0}-{1}", "MUL": "{0}*{1}", "DIV": "{0}/{1}"},
    **{"LT": "{0}<{1}", "LE": "{0}<={1}", "EQ": "{0}=={1}", "NE": "{0}!={1}"},
    **{"AND": "({0}!=0.)&({1}!=0.)", "OR": "({0}!=0.)|({1}!=0.)", "IF_ELSE_ZERO": "{0}!=0.?{1}:0."},
    **{"FMIN": "least({0},{1})", "FMAX": "most({0},{1})"},
    **{"POW": "power({0},{1})", "CONSTPOW": "power({0},{1})"},
    **{name: name.lower() + "({0},{1})" for name in ("FMOD", "REMAINDER", "ATAN2", "COPYSIGN", "HYPOT")},
}
HELPERS = """
static inline double sign(double x) { return x < 0. ? -1. : x > 0. ? 1. : x; }
static inline double least(double x, double y) { double r = x < y ? x : y; return y != y ? x : r; }
static inline double most(double x, double y) { double r = x > y ? x : y; return y != y ? x : r; }
#define power pow
"""
"""What the operations call beside the mathematical functions of C."""
