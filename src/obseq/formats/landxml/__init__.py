"""Surveys as LandXML."""
