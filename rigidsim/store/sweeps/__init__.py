"""Files of a sweep: sealed tiles, generations, and the one dataset that is gathered from them."""
