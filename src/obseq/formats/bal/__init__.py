"""Problems of Bundle Adjustment in the Large."""
