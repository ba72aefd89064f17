"""The program itself: computing times and error bars."""
