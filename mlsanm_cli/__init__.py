"""mlsanm: frictional contact between elastic bodies in the plane, without a mesh."""

__version__ = "0.1.0"
