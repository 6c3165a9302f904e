"""OBS and COR files, and free point files, of Comp3D and MMVII."""
