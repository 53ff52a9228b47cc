"""From rock and motions to runs, stored one by one."""
