"""What may be wrong with a block of images: one kind of mistake in each file, `registry.CAUSES` lists them."""
