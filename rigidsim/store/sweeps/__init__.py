"""Files of a sweep: sealed tiles of members under their keys, and the dataset gathered from them."""
