//! Boats: parametric models built here, glTF read from anywhere.
