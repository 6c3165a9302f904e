"""From batches to normal equations: patterns, the store of small blocks, elimination, threads."""
