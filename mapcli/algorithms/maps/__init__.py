"""Grid maps compared, aligned, transformed, turned into polygons and back."""
