"""Systems of any size: the matrix cut in parts that are eliminated one by one, here or by workers."""
