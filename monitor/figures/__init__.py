"""The style, canvas, legend, scale bar and site colours of all figures and pictures."""
