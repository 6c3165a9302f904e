"""The files of surveyors: OBS, COR and free point files."""
