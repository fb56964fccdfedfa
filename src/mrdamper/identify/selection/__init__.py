"""Which law and which of its terms: chosen by the error on motions that were left out."""
