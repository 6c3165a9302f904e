"""What may be wrong with a block of images: a kind of mistake in each file; registries list them."""
