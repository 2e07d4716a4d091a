"""What people look at: figures. They read datasets only."""
