"""Blade sections: polars, their continuation beyond stall, NeuralFoil tables and the section rule."""
