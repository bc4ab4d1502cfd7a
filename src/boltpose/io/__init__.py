"""Read and write the files users have; units and frames are settled here."""
