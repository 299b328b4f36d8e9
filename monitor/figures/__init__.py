"""What all figures and pictures share: style, canvas, legend, scale bar, colours of what a site has."""
