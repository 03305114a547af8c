using System;
using System.Globalization;
using Nep.Unity;
using UnityEngine;

/// <summary>Converts the numbers of a line: "vector X Y Z" or "rotation X Y Z W", to Unity and back to ROS.</summary>
internal static class Conversions
{
    private static void Main()
    {
        string line;
        while ((line = Console.ReadLine()) != null)
        {
            string[] words = line.Split(' ');
            double[] n = Array.ConvertAll(line.Substring(words[0].Length + 1).Split(' '), each => double.Parse(each, CultureInfo.InvariantCulture));
            if (words[0] == "vector")
            {
                Vector3 unity = RosConversions.ToUnity(n[0], n[1], n[2]);
                Vector3 ros = RosConversions.ToRos(unity);
                Say(unity.x, unity.y, unity.z, ros.x, ros.y, ros.z);
            }
            else
            {
                Quaternion unity = RosConversions.ToUnity(n[0], n[1], n[2], n[3]);
                Quaternion ros = RosConversions.ToRos(unity);
                Say(unity.x, unity.y, unity.z, unity.w, ros.x, ros.y, ros.z, ros.w);
            }
        }
    }

    private static void Say(params float[] numbers)
    {
        Console.WriteLine(string.Join(" ", Array.ConvertAll(numbers, each => each.ToString("R", CultureInfo.InvariantCulture))));
    }
}
