"""What physically touches: a Move, and fingers that execute it and return a Trace."""
