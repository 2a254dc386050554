"""What the studies of the real Moon and the rigid Earth share: lines of nutation, fitted."""
