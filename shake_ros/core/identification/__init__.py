"""Parameters from recordings: free-running simulation error, trust-region fits, uncertainty."""
