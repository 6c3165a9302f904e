"""Exports of PhotoModeler."""
