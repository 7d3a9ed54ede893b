"""A benchmark of missing physics: logs of machines whose models lack something, and the scoring of tools."""

from hovercontrol.identification.benchmark.answer import Answer, Term
from hovercontrol.identification.benchmark.cases import (
    Case,
    Truth,
    benchmark_case,
    benchmark_names,
    blind_names,
)
from hovercontrol.identification.benchmark.scoring import Score, score_answer

__all__ = [
    "Answer", "Term", "Case", "Truth", "Score",
    "benchmark_case", "benchmark_names", "blind_names", "score_answer",
]  # fmt: skip
