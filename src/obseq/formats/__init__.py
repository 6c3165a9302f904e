"""Files of surveys and of image blocks: one folder a program, all read into the same objects."""
