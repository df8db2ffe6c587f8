"""The papers by name."""

from cpg_ros.papers import buono_golubitsky, liu_zhang, oscillators, rashidi
from cpg_ros.papers.row import Paper

PAPERS: dict[str, Paper] = {paper.name: paper for paper in (
    liu_zhang.PAPER, buono_golubitsky.PAPER, rashidi.PAPER, *oscillators.PAPERS)}
