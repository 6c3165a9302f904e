"""Names of the operations on four doubles at a time, for compiled loops; `vector_instructions` has them."""

from __future__ import annotations

from obseq.compilation import Instruction

_HOME = "obseq.kernels.vector_instructions"

transpose3 = Instruction(_HOME, "transpose3")
transpose4 = Instruction(_HOME, "transpose4")
outer1 = Instruction(_HOME, "outer1")
outer4 = Instruction(_HOME, "outer4")
outer_threes = Instruction(_HOME, "outer_threes")
outer_columns_1 = Instruction(_HOME, "outer_columns_1")
outer_columns_2 = Instruction(_HOME, "outer_columns_2")
outer_columns_3 = Instruction(_HOME, "outer_columns_3")
outer_columns_1_by_3 = Instruction(_HOME, "outer_columns_1_by_3")
outer_columns_2_by_3 = Instruction(_HOME, "outer_columns_2_by_3")
outer_columns_3_by_3 = Instruction(_HOME, "outer_columns_3_by_3")
copy_threes = Instruction(_HOME, "copy_threes")
solve_threes = Instruction(_HOME, "solve_threes")
