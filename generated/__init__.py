"""What gencode wrote: one module per formula, checked in, read by people and edited by nobody."""
