"""What people look at: figures. They read datasets only."""

from headway.environment import check_figures

check_figures()
