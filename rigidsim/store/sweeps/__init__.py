"""Files of a sweep: sealed tiles, generations, and the dataset gathered from them."""
