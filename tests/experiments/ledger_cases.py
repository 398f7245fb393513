"""A claim and a file of the ledger, as small as they can be."""

from __future__ import annotations

from refsim.experiments.ledger_file import Claim

NUMBER = Claim("x", "hre", "section 1", "number", "ten", "equals", "e", "e", value="v", printed=10.0, tolerance=0.1,
               reason="a digit")  # fmt: skip
TWIN = """
[[claim]]
id = "a"
place = "section 1"
kind = "number"
says = "s"
rule = "unsaid"
"""
FILE = """
[paper]
title = "T"
authors = "A"
venue = "V"
year = 2000
figures = ["Figure 1"]

[[claim]]
id = "a"
item = "Figure 1"
place = "Figure 1"
kind = "figure"
says = "a figure"
experiment = "e"
table = "e"
value = "v"
rule = "equals"
printed = 3
"""
