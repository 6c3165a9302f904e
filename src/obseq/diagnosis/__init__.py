"""What is wrong with an adjustment, where, and by which slip: one engine for surveys and images.

It knows neither. A model (`protocol.Model`) tells it what may be wrong, as columns over the equations, and
adjusts with what it suspects.
"""
