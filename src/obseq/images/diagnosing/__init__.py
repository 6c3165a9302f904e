"""The diagnosis of a block of images: the model that the engine works on, and what it says."""
