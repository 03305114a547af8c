using System.Collections.Generic;

namespace Nep.Zmtp
{
    /// <summary>Comparer of byte arrays by their unsigned bytes; a prefix sorts before longer arrays.</summary>
    internal sealed class ByteOrder : IComparer<byte[]>, IEqualityComparer<byte[]>
    {
        public static readonly ByteOrder Instance = new ByteOrder();

        public static bool StartsWith(byte[] data, byte[] prefix)
        {
            if (data.Length < prefix.Length)
            {
                return false;
            }
            for (int i = 0; i < prefix.Length; i++)
            {
                if (data[i] != prefix[i])
                {
                    return false;
                }
            }
            return true;
        }

        public int Compare(byte[] left, byte[] right)
        {
            int common = left.Length < right.Length ? left.Length : right.Length;
            for (int i = 0; i < common; i++)
            {
                if (left[i] != right[i])
                {
                    return left[i] - right[i];
                }
            }
            return left.Length - right.Length;
        }

        public bool Equals(byte[] left, byte[] right)
        {
            return left.Length == right.Length && StartsWith(left, right);
        }

        public int GetHashCode(byte[] data)
        {
            int hash = 17;
            foreach (byte each in data)
            {
                hash = unchecked(hash * 31 + each);
            }
            return hash;
        }
    }
}
